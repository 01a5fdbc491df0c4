/* What this machine can do at best: bytes moved to and from memory and arithmetic per second.
 *
 * Memory: the triad a = b + s c of STREAM (McCalpin 1995) on arrays far larger than any cache; 12 bytes per element
 * count, what the processor reads in order to write is left out. Arithmetic: independent chains of fused
 * multiply-adds on full vectors of float32 in registers; each counts as two operations. The best pass counts.
 *
 * gcc -O3 -march=native -ffast-math -fopenmp machine_limits.c -lm
 * ./a.out SECONDS    prints one JSON object; OMP_NUM_THREADS sets the number of threads
 */
#include <omp.h>
#include <stdio.h>
#include <stdlib.h>

#if defined(__AVX512F__)
#define VECTOR_BYTES 64
#elif defined(__AVX__)
#define VECTOR_BYTES 32
#else
#define VECTOR_BYTES 16
#endif
#define CHAINS 12                   /* more than latency times units of any processor of today, fewer than registers */
#define ROUNDS 4000000
#define ELEMENTS (48L * 1024 * 1024) /* of each of three arrays, 576 MiB together */

typedef float Vector __attribute__((vector_size(VECTOR_BYTES)));

/* Bytes per second of the best pass. */
static double triad(double seconds) {
  float *a = aligned_alloc(64, ELEMENTS * sizeof(float));
  float *b = aligned_alloc(64, ELEMENTS * sizeof(float));
  float *c = aligned_alloc(64, ELEMENTS * sizeof(float));
  if (!a || !b || !c) {
    fprintf(stderr, "no memory for three arrays of %ld floats\n", ELEMENTS);
    exit(1);
  }
  #pragma omp parallel for simd schedule(static)
  for (long i = 0; i < ELEMENTS; i++) { a[i] = 0; b[i] = 1; c[i] = 2; }
  double best = 0, end = omp_get_wtime() + seconds;
  for (int pass = 0; pass < 3 || omp_get_wtime() < end; pass++) {
    float s = 1 + pass;
    double start = omp_get_wtime();
    #pragma omp parallel for simd schedule(static)
    for (long i = 0; i < ELEMENTS; i++) a[i] = b[i] + s * c[i];
    double rate = 3. * sizeof(float) * ELEMENTS / (omp_get_wtime() - start);
    if (rate > best) best = rate;
  }
  if (a[ELEMENTS - 1] < 3) exit(1); /* the sums are needed, so they are computed */
  free(a); free(b); free(c);
  return best;
}

/* Sum of what the chains of one thread come to. */
static float chains(float factor, float term) {
  Vector sums[CHAINS];
  float total = 0;
  for (int k = 0; k < CHAINS; k++) sums[k] = (Vector){0} + (float)k;
  for (int round = 0; round < ROUNDS; round++)
    #pragma GCC unroll 12
    for (int k = 0; k < CHAINS; k++) sums[k] = sums[k] * factor + term;
  for (int k = 0; k < CHAINS; k++) total += sums[k][0];
  return total;
}

/* Operations per second of the best pass. */
static double multiply_add(double seconds) {
  volatile float factor = 0.999f, term = 0.001f;
  double best = 0, end = omp_get_wtime() + seconds;
  double operations = 2. * CHAINS * ROUNDS * (VECTOR_BYTES / sizeof(float)) * omp_get_max_threads();
  for (int pass = 0; pass < 3 || omp_get_wtime() < end; pass++) {
    float total = 0;
    double start = omp_get_wtime();
    #pragma omp parallel reduction(+ : total)
    total += chains(factor, term);
    double rate = operations / (omp_get_wtime() - start);
    if (rate > best) best = rate;
    if (total == 0) exit(1);
  }
  return best;
}

int main(int argc, char **argv) {
  double seconds = argc > 1 ? atof(argv[1]) : 1;
  double bytes = triad(seconds), operations = multiply_add(seconds);
  printf("{\"threads\": %d, \"bytes_per_s\": %.6g, \"operations_per_s\": %.6g}\n", omp_get_max_threads(), bytes,
         operations);
}

/* The traffic model of this package without collisions, vectorised by hand: the speed a CPU core can reach.
 *
 * Sixteen scenarios fill the sixteen float32 lanes of a 512-bit register; all fields of such a group lie together,
 * [vehicle][scenario], and stay in the first-level cache. Groups are independent and shared out over threads.
 * IDM, MOBIL with politeness 0, lane-change aborts, steering and the bicycle model are those of highway-env 1.12.1;
 * the decision timer counts in seconds, and the ends of the road, the speed limit and collisions are left out.
 *
 * gcc -O3 -march=native -mprefer-vector-width=512 -ffast-math -fopenmp -DV=10 limit.c -lmvec -lm
 * ./a.out SCENARIOS [STEPS]    prints one JSON object; OMP_NUM_THREADS sets the number of threads
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#ifndef V
#define V 10 /* vehicles of a scenario */
#endif
#define W 16                    /* scenarios of a group */
#define LANES 4
#define LANE_WIDTH 4.0f         /* m */
#define TICK (1 / 15.f)         /* s */
#define NOBODY 1e9f             /* distance to a vehicle that is not there, m */
#define IS_SOMEBODY(d) ((d) < 5e8f)

/* IDM in highway-env's form: s0 = 10 m is measured between centres. */
static const float MAX_ACCEL = 3, JAM_SPACING = 10, TIME_GAP = 1.5f;
#define CLOSING_GAIN (1 / (2 * sqrtf(15.f))) /* 1 / (2 sqrt(a b)), a = 3 and b = 5 m/s^2 */

typedef struct {
  float x[V][W], y[V][W], heading[V][W], speed[V][W];
  float target_lane[V][W], desired_speed[V][W], exponent[V][W], timer[V][W];
  float lane[V][W], accel[V][W], steering[V][W], cos_heading[V][W];
} Group;

/* Left to itself gcc sets the larger of these apart, which costs 5 % at 30 vehicles. */
#define INLINED static inline __attribute__((always_inline))

static inline float not_zero(float x) { return fabsf(x) > 1e-2f ? x : (x >= 0 ? 1e-2f : -1e-2f); }

static inline float clip(float x, float low, float high) { return fminf(fmaxf(x, low), high); }

static inline float desired_gap(float speed, float leader_speed) {
  return JAM_SPACING + speed * TIME_GAP + speed * (speed - leader_speed) * CLOSING_GAIN;
}

/* IDM acceleration, m/s^2; has_leader is 0 or 1. */
static inline float idm(float speed, float desired_speed, float exponent, float distance, float leader_speed,
                        float has_leader) {
  float free_road = MAX_ACCEL * (1 - expf(exponent * logf(fmaxf(speed, 1e-6f) / desired_speed)));
  float ratio = desired_gap(speed, leader_speed) / not_zero(distance);
  return free_road - has_leader * MAX_ACCEL * ratio * ratio;
}

/* Distance and speed along the road of the nearest vehicle ahead of vehicle i on the given lanes. */
static void find_leader(const Group *g, int i, const float *lane, float *distance, float *speed) {
  for (int w = 0; w < W; w++) { distance[w] = NOBODY; speed[w] = 0; }
  for (int j = 0; j < V; j++) if (j != i) {
    #pragma omp simd
    for (int w = 0; w < W; w++) {
      float dx = g->x[j][w] - g->x[i][w];
      int ok = (fabsf(g->y[j][w] - lane[w] * LANE_WIDTH) <= 3.f) & (dx >= 0) & (dx < distance[w]);
      distance[w] = ok ? dx : distance[w];
      speed[w] = ok ? g->speed[j][w] * g->cos_heading[j][w] : speed[w];
    }
  }
}

/* Distance, speed, desired speed and exponent of the nearest vehicle behind vehicle i on the given lanes. */
static void find_follower(const Group *g, int i, const float *lane, float *distance, float *speed, float *desired,
                          float *exponent) {
  for (int w = 0; w < W; w++) { distance[w] = NOBODY; speed[w] = 0; desired[w] = 1; exponent[w] = 4; }
  for (int j = 0; j < V; j++) if (j != i) {
    #pragma omp simd
    for (int w = 0; w < W; w++) {
      float dx = g->x[i][w] - g->x[j][w];
      int ok = (fabsf(g->y[j][w] - lane[w] * LANE_WIDTH) <= 3.f) & (dx > 0) & (dx < distance[w]);
      distance[w] = ok ? dx : distance[w];
      speed[w] = ok ? g->speed[j][w] : speed[w];
      desired[w] = ok ? g->desired_speed[j][w] : desired[w];
      exponent[w] = ok ? g->exponent[j][w] : exponent[w];
    }
  }
}

/* MOBIL for vehicle i where a decision is due: left, then right; the last lane that passes is taken. */
INLINED void decide_lane(Group *g, int i, const float *due, const float *leader_distance,
                         const float *leader_speed) {
  for (int side = -1; side <= 1; side += 2) {
    float lane[W], ahead[W], ahead_speed[W], behind[W], behind_speed[W], behind_desired[W], behind_exponent[W];
    for (int w = 0; w < W; w++) lane[w] = g->lane[i][w] + side;
    find_leader(g, i, lane, ahead, ahead_speed);
    find_follower(g, i, lane, behind, behind_speed, behind_desired, behind_exponent);
    #pragma omp simd
    for (int w = 0; w < W; w++) {
      float speed = g->speed[i][w], desired = g->desired_speed[i][w], exponent = g->exponent[i][w];
      float imposed = IS_SOMEBODY(behind[w])
        ? idm(behind_speed[w], behind_desired[w], behind_exponent[w], behind[w], speed, 1) : 0;
      float there = idm(speed, desired, exponent, ahead[w], ahead_speed[w], IS_SOMEBODY(ahead[w]));
      float here = idm(speed, desired, exponent, leader_distance[w], leader_speed[w], IS_SOMEBODY(leader_distance[w]));
      int ok = (imposed >= -2) & (there - here >= 0.2f) & (lane[w] >= 0) & (lane[w] < LANES)
        & (fabsf(speed) >= 1) & (due[w] > 0);
      g->target_lane[i][w] = ok ? lane[w] : g->target_lane[i][w];
    }
  }
}

/* Vehicle i gives its change up where another one heads for the same lane just ahead of it. */
INLINED void abort_conflicts(Group *g, int i) {
  for (int j = 0; j < V; j++) if (j != i) {
    #pragma omp simd
    for (int w = 0; w < W; w++) {
      float dx = g->x[j][w] - g->x[i][w];
      float gap = desired_gap(g->speed[i][w], g->speed[j][w]);
      int conflict = (g->lane[i][w] != g->target_lane[i][w]) & (g->target_lane[j][w] == g->target_lane[i][w])
        & (g->lane[j][w] != g->target_lane[i][w]) & (dx > 0) & (dx < gap);
      g->target_lane[i][w] = conflict ? g->lane[i][w] : g->target_lane[i][w];
    }
  }
}

/* Lane change, acceleration and steering of vehicle i. */
INLINED void act(Group *g, int i) {
  float distance[W], leader_speed[W], target_distance[W], target_speed[W], due[W];
  int any_due = 0, any_changing = 0;
  for (int w = 0; w < W; w++) {
    int is_due = (g->timer[i][w] >= 1.f) & (g->lane[i][w] == g->target_lane[i][w]);
    due[w] = is_due;
    any_due |= is_due;
  }
  find_leader(g, i, g->lane[i], distance, leader_speed);
  if (any_due) {
    decide_lane(g, i, due, distance, leader_speed);
    for (int w = 0; w < W; w++) g->timer[i][w] = due[w] > 0 ? 0 : g->timer[i][w];
  }
  for (int w = 0; w < W; w++) any_changing |= g->lane[i][w] != g->target_lane[i][w];
  if (any_changing) {
    abort_conflicts(g, i);
    find_leader(g, i, g->target_lane[i], target_distance, target_speed);
  } else {
    memcpy(target_distance, distance, sizeof distance);
    memcpy(target_speed, leader_speed, sizeof leader_speed);
  }
  #pragma omp simd
  for (int w = 0; w < W; w++) {
    float v = g->speed[i][w], desired = g->desired_speed[i][w], exponent = g->exponent[i][w];
    float a = idm(v, desired, exponent, distance[w], leader_speed[w], IS_SOMEBODY(distance[w]));
    float b = idm(v, desired, exponent, target_distance[w], target_speed[w], IS_SOMEBODY(target_distance[w]));
    g->accel[i][w] = clip(fminf(a, b), -6, 6);
    float lateral = g->y[i][w] - g->target_lane[i][w] * LANE_WIDTH;
    float heading = clip(asinf(clip(-lateral / 0.6f / not_zero(v), -1, 1)), -0.785398f, 0.785398f);
    float slip = asinf(clip(2.5f / not_zero(v) * 5 * (heading - g->heading[i][w]), -1, 1));
    g->steering[i][w] = clip(atanf(2 * tanf(slip)), -1.0472f, 1.0472f);
  }
}

/* One step of a group: see, act one after the other, move all. */
static void step(Group *g) {
  for (int i = 0; i < V; i++) {
    #pragma omp simd
    for (int w = 0; w < W; w++) {
      g->lane[i][w] = clip(rintf(g->y[i][w] / LANE_WIDTH), 0, LANES - 1);
      g->cos_heading[i][w] = cosf(g->heading[i][w]);
    }
  }
  for (int i = 0; i < V; i++) act(g, i);
  for (int i = 0; i < V; i++) {
    #pragma omp simd
    for (int w = 0; w < W; w++) {
      float slip = atanf(0.5f * tanf(g->steering[i][w])), v = g->speed[i][w], heading = g->heading[i][w];
      g->x[i][w] += v * cosf(heading + slip) * TICK;
      g->y[i][w] += v * sinf(heading + slip) * TICK;
      g->heading[i][w] += v * sinf(slip) / 2.5f * TICK;
      g->speed[i][w] += g->accel[i][w] * TICK;
      g->timer[i][w] += TICK;
    }
  }
}

/* Random traffic: each vehicle 10 to 25 m ahead of the one before it, on any lane. */
static void spawn(Group *groups, int n_groups) {
  srand(0);
  for (int k = 0; k < n_groups; k++) for (int w = 0; w < W; w++) {
    Group *g = groups + k;
    float x = 0;
    for (int i = 0; i < V; i++) {
      x += 10 + 15.f * rand() / RAND_MAX;
      int lane = rand() % LANES;
      g->x[i][w] = x;
      g->y[i][w] = lane * LANE_WIDTH;
      g->target_lane[i][w] = lane;
      g->heading[i][w] = 0;
      g->speed[i][w] = 21 + 3.f * rand() / RAND_MAX;
      g->desired_speed[i][w] = 21 + 9.f * rand() / RAND_MAX;
      g->exponent[i][w] = 3.5f + 1.f * rand() / RAND_MAX;
      g->timer[i][w] = 1.f * rand() / RAND_MAX;
    }
  }
}

static double now(clockid_t clock) {
  struct timespec t;
  clock_gettime(clock, &t);
  return t.tv_sec + 1e-9 * t.tv_nsec;
}

int main(int argc, char **argv) {
  int n_scenarios = argc > 1 ? atoi(argv[1]) : 0, n_steps = argc > 2 ? atoi(argv[2]) : 900;
  if (n_scenarios < 1 || n_scenarios % W || n_steps < 1) {
    fprintf(stderr, "usage: %s SCENARIOS [STEPS], SCENARIOS a multiple of %d\n", argv[0], W);
    return 2;
  }
  int n_groups = n_scenarios / W;
  Group *groups = aligned_alloc(64, sizeof(Group) * n_groups);
  if (!groups) {
    fprintf(stderr, "no memory for %d scenarios\n", n_scenarios);
    return 1;
  }
  spawn(groups, n_groups);
  double wall = now(CLOCK_MONOTONIC), cpu = now(CLOCK_PROCESS_CPUTIME_ID);
  #pragma omp parallel for schedule(dynamic)
  for (int k = 0; k < n_groups; k++)
    for (int t = 0; t < n_steps; t++) step(groups + k);
  wall = now(CLOCK_MONOTONIC) - wall;
  cpu = now(CLOCK_PROCESS_CPUTIME_ID) - cpu;
  double sum = 0;
  for (int k = 0; k < n_groups; k++)
    for (int i = 0; i < V; i++)
      for (int w = 0; w < W; w++) sum += groups[k].speed[i][w];
  printf("{\"vehicles\": %d, \"scenarios\": %d, \"steps\": %d, \"cpu_s\": %.6f, \"wall_s\": %.6f, \"mean_speed\": %.6f}\n",
         V, n_scenarios, n_steps, cpu, wall, sum / ((double)n_scenarios * V));
  free(groups);
}

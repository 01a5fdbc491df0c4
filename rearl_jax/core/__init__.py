"""The traffic model: IDM and MOBIL vehicles on a straight road, many scenarios in lockstep, pure JAX."""

"""The traffic core compared with highway-env: the same scenes in both, compared at every tick.

`scenarios` draws scenes, `reference` (the only module that imports highway-env) runs them in worker processes,
`simulation` runs them in the core, `comparison` measures the differences, `causes` names the cause of each difference
above the tolerance.
"""

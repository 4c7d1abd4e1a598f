"""Forecasters: baselines without learning, and the style-conditioned network. The only package that imports torch.

`import stylesim.forecasting` itself loads no torch: take `training.train`, `checkpoint.load`,
`style_embedding.StyleContextEmbedding` and `baselines.ConstantVelocity` from their modules.
"""

import os

# Before torch is loaded: its OpenMP threads shall sleep at barriers, not spin. The layers are small, so there are
# many barriers; beside other busy processes spinning cost a factor of 10 to 20 (two cores, load 7: 14-19 samples/s in
# training against 180-390; what it costs on a quiet machine was not measured). What the user has set stays.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

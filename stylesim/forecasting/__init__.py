"""Forecasters: baselines without learning, and the style-conditioned network. The only package that imports torch.

`import stylesim.forecasting` itself loads no torch: take `training.train`, `checkpoint.load`,
`style_embedding.StyleContextEmbedding` and `baselines.ConstantVelocity` from their modules.
"""

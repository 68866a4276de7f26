"""Studies of the product by its own parts; the product never imports them."""

import chainslam.experiments  # noqa: F401  # Before numpy: it decides how BLAS sums.

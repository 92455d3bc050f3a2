# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What the command line says where memory ends."""

OUT_OF_MEMORY = (
    b"error: out of memory; what was there before is intact. Close other programs or raise the limit, and "
    b"the same command goes on; or ask for less, with a lower --resolution, fewer --texels or, above "
    b"what the machine has, a lower --memory\n"
)

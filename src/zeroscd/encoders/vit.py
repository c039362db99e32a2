"""A plain vision transformer, ViT-S/16 as place recognition uses it, on any grid of patches."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import torch
from torch import nn
from torch.nn import functional

from zeroscd.encoders.positions import bicubic_positions

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import TypeAlias

    from torch import Tensor

    FitPositions: TypeAlias = Callable[[Tensor, tuple[int, int]], Tensor]


@dataclass(frozen=True, slots=True, kw_only=True)
class VitShape:
    """The dimensions of a vision transformer; the defaults are ViT-S/16.

    Attributes:
        dim: Length of a token.
        depth: Number of blocks.
        heads: Attention heads of a block.
        patch_px: Side of a patch, in pixels.
        grid_hw: Patch rows and columns that the position embedding was trained for.
        distilled: There is a distillation token after the class token.
        head_dim: Length of the retrieval descriptor; None = the network has no retrieval head.
    """

    dim: int = 384
    depth: int = 12
    heads: int = 6
    patch_px: int = 16
    grid_hw: tuple[int, int] = (30, 40)
    distilled: bool = False
    head_dim: int | None = None

    @property
    def prefix(self) -> int:
        """Number of tokens before the patches."""
        return 2 if self.distilled else 1


class Attention(nn.Module):
    """Multi-head self-attention with one joint projection (arXiv 2010.11929, appendix A)."""

    def __init__(self, shape: VitShape) -> None:
        super().__init__()
        self.heads = shape.heads
        self.qkv = nn.Linear(shape.dim, 3 * shape.dim)
        self.proj = nn.Linear(shape.dim, shape.dim)

    def forward(self, tokens: Tensor) -> Tensor:
        """Attend over all tokens, (B, N, dim) to the same."""
        batch, count, dim = tokens.shape
        joint = self.qkv(tokens).reshape(batch, count, 3, self.heads, dim // self.heads)
        query, key, value = joint.permute(2, 0, 3, 1, 4)
        mixed = functional.scaled_dot_product_attention(query, key, value)
        out: Tensor = self.proj(mixed.transpose(1, 2).reshape(batch, count, dim))
        return out


class Mlp(nn.Module):
    """Two linear layers with a GELU between them, four times as wide inside."""

    def __init__(self, dim: int) -> None:
        super().__init__()
        self.fc1 = nn.Linear(dim, 4 * dim)
        self.fc2 = nn.Linear(4 * dim, dim)

    def forward(self, tokens: Tensor) -> Tensor:
        """Map each token, (B, N, dim) to the same."""
        out: Tensor = self.fc2(functional.gelu(self.fc1(tokens)))
        return out


class Block(nn.Module):
    """Pre-norm attention and MLP, each with a residual connection."""

    def __init__(self, shape: VitShape) -> None:
        super().__init__()
        self.norm1 = nn.LayerNorm(shape.dim, eps=1e-6)
        self.attn = Attention(shape)
        self.norm2 = nn.LayerNorm(shape.dim, eps=1e-6)
        self.mlp = Mlp(shape.dim)

    def forward(self, tokens: Tensor) -> Tensor:
        """Transform tokens; (B, N, dim) to the same."""
        tokens = tokens + self.attn(self.norm1(tokens))
        out: Tensor = tokens + self.mlp(self.norm2(tokens))
        return out


class PatchEmbed(nn.Module):
    """Linear projection of the patches, as a convolution."""

    def __init__(self, shape: VitShape) -> None:
        super().__init__()
        self.proj = nn.Conv2d(3, shape.dim, kernel_size=shape.patch_px, stride=shape.patch_px)

    def forward(self, pixels: Tensor) -> Tensor:
        """Turn (B, 3, H, W) into (B, dim, rows, cols)."""
        out: Tensor = self.proj(pixels)
        return out


class VisionTransformer(nn.Module):
    """The transformer; its tensors are named as in timm's DeiT, as checkpoints are.

    Args:
        shape: Its dimensions.
        fit_positions: Fits the position embedding (h, w, dim) of the trained grid to another.
    """

    def __init__(self, shape: VitShape, *, fit_positions: FitPositions = bicubic_positions) -> None:
        super().__init__()
        self.shape, self.fit_positions = shape, fit_positions
        rows, cols = shape.grid_hw
        self.patch_embed = PatchEmbed(shape)
        self.cls_token = nn.Parameter(torch.zeros(1, 1, shape.dim))
        if shape.distilled:
            self.dist_token = nn.Parameter(torch.zeros(1, 1, shape.dim))
        self.pos_embed = nn.Parameter(torch.zeros(1, shape.prefix + rows * cols, shape.dim))
        self.blocks = nn.ModuleList(Block(shape) for _ in range(shape.depth))
        self.norm = nn.LayerNorm(shape.dim, eps=1e-6)
        if shape.head_dim is not None:
            self.head = nn.Linear(shape.dim, shape.head_dim)
            if shape.distilled:
                self.head_dist = nn.Linear(shape.dim, shape.head_dim)

    def tokens(self, pixels: Tensor, *, layer: int) -> tuple[Tensor, Tensor]:
        """Return the tokens after a block.

        Args:
            pixels: (B, 3, H, W) normalised; sides are multiples of the patch side.
            layer: 1..depth; the final norm is applied after the last block only.

        Returns:
            Prefix tokens (B, 1 or 2, dim) and patch tokens (B, rows, cols, dim).
        """
        patches = self.patch_embed(pixels)
        batch, dim, rows, cols = patches.shape
        tokens = torch.cat([self._prefix(batch), patches.flatten(2).transpose(1, 2)], dim=1)
        tokens = tokens + self.positions((rows, cols))
        for block in self.blocks[:layer]:
            tokens = block(tokens)
        if layer == self.shape.depth:
            tokens = self.norm(tokens)
        prefix = self.shape.prefix
        return tokens[:, :prefix], tokens[:, prefix:].reshape(batch, rows, cols, dim)

    def positions(self, grid_hw: tuple[int, int]) -> Tensor:
        """Return the position embedding for any grid, (1, prefix + rows * cols, dim)."""
        if grid_hw == self.shape.grid_hw:
            return self.pos_embed
        prefix = self.shape.prefix
        trained = self.pos_embed[0, prefix:].reshape(*self.shape.grid_hw, self.shape.dim)
        fitted = self.fit_positions(trained, grid_hw).flatten(0, 1)
        return torch.cat([self.pos_embed[:, :prefix], fitted[None]], dim=1)

    def global_descriptor(self, pixels: Tensor) -> Tensor:
        """Return one unit descriptor of the whole photo, (B, head_dim).

        With a distillation token: the mean of both heads (R2Former, arXiv 2304.03410). Without:
        the head of the mean patch token (PlaceFormer, arXiv 2401.13082).
        """
        prefix, patches = self.tokens(pixels, layer=self.shape.depth)
        if self.shape.distilled:
            joint = (self.head(prefix[:, 0]) + self.head_dist(prefix[:, 1])) / 2
        else:
            joint = self.head(patches.mean(dim=(1, 2)))
        return functional.normalize(joint, dim=1)

    def _prefix(self, batch: int) -> Tensor:
        names = ("cls_token", "dist_token")[: self.shape.prefix]
        return torch.cat([getattr(self, name).expand(batch, -1, -1) for name in names], dim=1)

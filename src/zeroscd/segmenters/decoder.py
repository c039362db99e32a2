"""SAM's mask decoder, arranged for many points on one photo: the same numbers, in less time.

transformers' decoder repeats the photo's 64 x 64 tokens for every point and projects them anew in
every attention. Here what all points share is computed once, and each projection of photo tokens
(thousands) is moved over to the tokens of the point (seven or eight): q . (W k) = (W^T q) . k. That
changes no result beyond rounding; a test compares both.

Source: mask decoders of arXiv 2304.02643 and 2408.00714, with the weights of transformers' modules.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import torch
from torch.nn import functional

if TYPE_CHECKING:
    from torch import Tensor

MASKS = 3  # answers to a point; the decoder's token 0 is for other prompts


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """What the decoder needs of a photo, the same for every point.

    Attributes:
        tokens: (1, P, dim) the photo's tokens, row by row, P = side * side.
        positions: (P, dim) their position encoding.
        first_seen: Keys and values (1, heads, P, c) that the first layer's points look at.
        first_asking: (P, heads * c) with what the photo's tokens ask the points in that layer.
        side: Of the square of tokens.
        finer: Added after the first and the second upscaling: (P, 4, c) and (P, 4, 4, c) from
            SAM 2's finer features, or just the biases.
    """

    tokens: Tensor
    positions: Tensor
    first_seen: tuple[Tensor, Tensor]
    first_asking: Tensor
    side: int
    finer: tuple[Tensor, Tensor]

    @property
    def size_bytes(self) -> int:
        """Memory that all of it takes."""
        tensors = (self.tokens, self.positions, *self.first_seen, self.first_asking, *self.finer)
        return sum(one.nbytes for one in tensors)


def scene_of(model: Any, embedding: Any) -> Scene:  # noqa: ANN401 - transformers carries no types
    """Prepare a photo's embedding.

    Args:
        model: transformers' SamModel or Sam2Model.
        embedding: Of its image encoder: (1, dim, S, S), or a list of three, finest first.
    """
    *fine, coarse = embedding if isinstance(embedding, list | tuple) else [embedding]
    positions = model.get_image_wide_positional_embeddings()[0].flatten(1).T.contiguous()
    plain = coarse.flatten(2).transpose(1, 2)
    tokens = (plain + model.prompt_encoder.no_mask_embed.weight).contiguous()
    decoder = model.mask_decoder
    first = decoder.transformer.layers[0]
    look = first.cross_attn_token_to_image
    seen = [look.k_proj(tokens + positions), look.v_proj(tokens)]
    keys, values = (_by_head(one, look.num_attention_heads).transpose(1, 2) for one in seen)
    biases = [decoder.upscale_conv1.bias, decoder.upscale_conv2.bias]
    if fine:
        biases[0] = biases[0] + _halves(fine[1][0], steps=1)
        biases[1] = biases[1] + _halves(fine[0][0], steps=2)
    return Scene(
        tokens=tokens,
        positions=positions,
        first_seen=(keys, values),
        first_asking=first.cross_attn_image_to_token.q_proj(tokens[0] + positions),
        side=coarse.shape[-1],
        finer=(biases[0], biases[1]),
    )


def decode(decoder: Any, scene: Scene, prompts: Tensor) -> tuple[Tensor, Tensor]:  # noqa: ANN401
    """Answer points.

    Args:
        decoder: The model's mask decoder.
        scene: Of the photo.
        prompts: (N, 2, dim) encoded points, each with the padding token that follows it.

    Returns:
        (N, 3, 4 S, 4 S) logits and (N, 3) scores.
    """
    first = [decoder.obj_score_token.weight] if hasattr(decoder, "obj_score_token") else []
    own = torch.cat([*first, decoder.iou_token.weight, decoder.mask_tokens.weight])
    tokens = torch.cat([own.expand(len(prompts), -1, -1), prompts], dim=1)
    queries, photo = _talk(decoder.transformer, tokens, scene)
    score_at = len(first)
    heads = decoder.output_hypernetworks_mlps
    filters = [heads[mask](queries[:, score_at + 1 + mask]) for mask in range(1, 1 + MASKS)]
    logits = _paint(decoder, photo, scene, torch.stack(filters, dim=2))
    return logits, decoder.iou_prediction_head(queries[:, score_at])[:, 1:]


def _talk(transformer: Any, tokens: Tensor, scene: Scene) -> tuple[Tensor, Tensor]:  # noqa: ANN401
    """Let the points' tokens and the photo's tokens attend to each other."""
    queries, photo = tokens, scene.tokens
    for number, layer in enumerate(transformer.layers):
        # The first layer has nothing yet to add the prompts to: its queries are the prompts.
        asking = queries if layer.skip_first_layer_pe else queries + tokens
        mixed = _attend_to_each_other(layer.self_attn, asking, queries)
        queries = layer.layer_norm1(mixed if layer.skip_first_layer_pe else queries + mixed)
        placed = photo + scene.positions
        look, listen = layer.cross_attn_token_to_image, layer.cross_attn_image_to_token
        if number == 0:
            seen = _look_at_shared(look, queries + tokens, scene)
        else:
            seen = _look_at_photo(look, queries + tokens, photo, placed)
        queries = layer.layer_norm2(queries + seen)
        queries = layer.layer_norm3(queries + layer.mlp(queries))
        keys = _by_head(listen.k_proj(queries + tokens), listen.num_attention_heads)
        keys = keys * listen.scaling
        scores = _shared_scores(keys, scene) if number == 0 else _scores(listen, keys, placed)
        photo = layer.layer_norm4(_listen_to_points(listen, scores, queries, photo))
    last = transformer.final_attn_token_to_image
    seen = _look_at_photo(last, queries + tokens, photo, photo + scene.positions)
    return transformer.layer_norm_final_attn(queries + seen), photo


def _attend_to_each_other(attention: Any, asking: Tensor, values: Tensor) -> Tensor:  # noqa: ANN401
    mixed: Tensor = attention(query=asking[None], key=asking[None], value=values[None])[0][0]
    return mixed


def _look_at_shared(attention: Any, queries: Tensor, scene: Scene) -> Tensor:  # noqa: ANN401
    """Tokens of all points (N, T, dim) gather from the photo as it is before the first layer."""
    points, count, _ = queries.shape
    own = _by_head(attention.q_proj(queries).flatten(0, 1)[None], attention.num_attention_heads)
    keys, values = scene.first_seen
    seen = functional.scaled_dot_product_attention(own.transpose(1, 2), keys, values)
    out: Tensor = _output(attention)(seen.transpose(1, 2).reshape(points, count, -1))
    return out


def _look_at_photo(attention: Any, queries: Tensor, photo: Tensor, placed: Tensor) -> Tensor:  # noqa: ANN401
    """Tokens of points (N, T, dim) gather from their own photo tokens (N, P, dim)."""
    heads = attention.num_attention_heads
    own = _by_head(attention.q_proj(queries), heads) * attention.scaling
    # A bias of the keys would add the same to all of a query's scores: softmax ignores it.
    probes = torch.einsum("nthc,hcd->nthd", own, _rows_by_head(attention.k_proj.weight, heads))
    scores = torch.matmul(probes.flatten(1, 2), placed.transpose(1, 2))
    gathered = torch.unflatten(torch.matmul(scores.softmax(dim=2), photo), 1, (-1, heads))
    values = torch.einsum("nthd,hcd->nthc", gathered, _rows_by_head(attention.v_proj.weight, heads))
    out: Tensor = _output(attention)(values.flatten(2) + attention.v_proj.bias)
    return out


def _shared_scores(keys: Tensor, scene: Scene) -> Tensor:
    """Scores of the points' keys (N, T, heads, c) for the photo before the first layer."""
    own = torch.eye(keys.shape[2], dtype=keys.dtype, device=keys.device)
    apart = torch.einsum("nthc,hk->nhctk", keys, own).flatten(3).flatten(1, 2)  # a head sees itself
    return torch.matmul(scene.first_asking, apart)


def _scores(attention: Any, keys: Tensor, placed: Tensor) -> Tensor:  # noqa: ANN401
    """Scores of the points' keys for their own photo tokens, (N, P, T * heads)."""
    rows = _rows_by_head(attention.q_proj.weight, keys.shape[2])
    probes = torch.einsum("nthc,hcd->nthd", keys, rows).flatten(1, 2)
    shift = (keys * _rows_by_head(attention.q_proj.bias, keys.shape[2])).sum(dim=3).flatten(1)
    return torch.matmul(placed, probes.transpose(1, 2)) + shift[:, None]


def _listen_to_points(attention: Any, scores: Tensor, queries: Tensor, photo: Tensor) -> Tensor:  # noqa: ANN401
    """The photo's tokens plus what they gather from the tokens of each point, (N, P, dim)."""
    heads, output = attention.num_attention_heads, _output(attention)
    shares = torch.unflatten(scores, 2, (-1, heads)).softmax(dim=2).flatten(2)
    values = _by_head(attention.v_proj(queries), heads)
    gifts = torch.einsum("nthc,dhc->nthd", values, torch.unflatten(output.weight, 1, (heads, -1)))
    gifts = gifts + output.bias / heads  # the shares of each head sum to 1
    return photo + torch.matmul(shares, gifts.flatten(1, 2))


def _by_head(tokens: Tensor, heads: int) -> Tensor:
    split: Tensor = torch.unflatten(tokens, 2, (heads, -1))
    return split


def _rows_by_head(weight: Tensor, heads: int) -> Tensor:
    rows: Tensor = torch.unflatten(weight, 0, (heads, -1))
    return rows


def _output(attention: Any) -> Any:  # noqa: ANN401
    """The last projection, by either generation's name."""
    return attention.out_proj if hasattr(attention, "out_proj") else attention.o_proj


def _paint(decoder: Any, photo: Tensor, scene: Scene, filters: Tensor) -> Tensor:  # noqa: ANN401
    """Upscale the photo's tokens twice and weigh their channels, (N, 3, 4 S, 4 S).

    A transposed convolution whose steps are as long as its kernel is one matrix product; channels
    stay last, so that nothing is moved until the masks are there.
    """
    norm = decoder.upscale_layer_norm
    finer = _twice(photo, decoder.upscale_conv1.weight) + scene.finer[0]
    finer = functional.layer_norm(finer, norm.normalized_shape, norm.weight, norm.bias, norm.eps)
    finest = _twice(functional.gelu(finer), decoder.upscale_conv2.weight) + scene.finer[1]
    painted = torch.matmul(functional.gelu(finest).flatten(1, 3), filters)
    side = scene.side
    cells = painted.reshape(-1, side, side, 2, 2, 2, 2, MASKS)
    return cells.permute(0, 7, 1, 3, 5, 2, 4, 6).reshape(-1, MASKS, 4 * side, 4 * side)


def _twice(cells: Tensor, weight: Tensor) -> Tensor:
    """Make four cells of each: (..., c) and (c, d, 2, 2) to (..., 4, d)."""
    return torch.unflatten(torch.matmul(cells, weight.permute(0, 2, 3, 1).flatten(1)), -1, (4, -1))


def _halves(features: Tensor, *, steps: int) -> Tensor:
    """Bring finer features (c, H, W) to the order in which upscaling makes cells, (P, 4, .., c)."""
    channels, height, width = features.shape
    cells = 2**steps
    split = features.reshape(channels, height // cells, *[2] * steps, width // cells, *[2] * steps)
    rows = [2 + step for step in range(steps)]
    cols = [3 + steps + step for step in range(steps)]
    pairs = [axis for pair in zip(rows, cols, strict=True) for axis in pair]
    ordered = split.permute(1, 2 + steps, *pairs, 0)
    return ordered.reshape(height // cells * width // cells, *[4] * steps, channels)

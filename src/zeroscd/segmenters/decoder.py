"""SAM's mask decoder, arranged for many points on one photo: the same numbers, in less time.

transformers' decoder repeats the 64 x 64 image tokens for every point and projects them again in
every attention. Here everything that all points share is computed once, and each projection of
image tokens (thousands) is moved to the prompt tokens (seven or eight): q . (W k) = (W^T q) . k.
Results change by rounding only; a test compares both.

Source: mask decoders of arXiv 2304.02643 and 2408.00714, with the weights of transformers' modules.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import torch
from torch.nn import functional

if TYPE_CHECKING:
    from torch import Tensor

MASKS = 3  # per point; the decoder's mask token 0 is for other prompts


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageTokens:
    """What the decoder needs to know of a photo; the same for every point.

    Attributes:
        tokens: (1, P, dim) image tokens, row by row, P = side * side.
        positions: (P, dim) their position encoding.
        first_keys_values: Keys and values, (1, heads, P, c) each, of the image tokens in the
            first layer.
        first_queries: (P, heads * c) queries of the image tokens in the first layer.
        side: Rows and columns of the square of tokens.
        upscale_biases: Added after the first and the second upscaling: (P, 4, c) and (P, 4, 4, c)
            with SAM 2's high-resolution features, otherwise just the biases.
    """

    tokens: Tensor
    positions: Tensor
    first_keys_values: tuple[Tensor, Tensor]
    first_queries: Tensor
    side: int
    upscale_biases: tuple[Tensor, Tensor]

    @property
    def size_bytes(self) -> int:
        """Memory that all of it takes."""
        pairs = (*self.first_keys_values, *self.upscale_biases)
        tensors = (self.tokens, self.positions, self.first_queries, *pairs)
        return sum(tensor.nbytes for tensor in tensors)


def image_tokens(model: Any, embedding: Any) -> ImageTokens:  # noqa: ANN401 - transformers is untyped
    """Prepare a photo's embedding for the decoder.

    Args:
        model: transformers' SamModel or Sam2Model.
        embedding: From its image encoder: (1, dim, S, S), or a list of three, finest first.
    """
    *fine, coarse = embedding if isinstance(embedding, list | tuple) else [embedding]
    positions = model.get_image_wide_positional_embeddings()[0].flatten(1).T.contiguous()
    plain = coarse.flatten(2).transpose(1, 2)
    tokens = (plain + model.prompt_encoder.no_mask_embed.weight).contiguous()
    decoder = model.mask_decoder
    first = decoder.transformer.layers[0]
    attention = first.cross_attn_token_to_image
    projected = [attention.k_proj(tokens + positions), attention.v_proj(tokens)]
    heads = attention.num_attention_heads
    keys, values = (_by_head(one, heads).transpose(1, 2) for one in projected)
    biases = [decoder.upscale_conv1.bias, decoder.upscale_conv2.bias]
    if fine:
        biases[0] = biases[0] + _in_upscaled_order(fine[1][0], steps=1)
        biases[1] = biases[1] + _in_upscaled_order(fine[0][0], steps=2)
    return ImageTokens(
        tokens=tokens,
        positions=positions,
        first_keys_values=(keys, values),
        first_queries=first.cross_attn_image_to_token.q_proj(tokens[0] + positions),
        side=coarse.shape[-1],
        upscale_biases=(biases[0], biases[1]),
    )


def decode(decoder: Any, image: ImageTokens, prompts: Tensor) -> tuple[Tensor, Tensor]:  # noqa: ANN401
    """Predict masks for points.

    Args:
        decoder: The model's mask decoder.
        image: The photo.
        prompts: (N, 2, dim) encoded points, each with its padding token.

    Returns:
        (N, 3, 4 S, 4 S) logits and (N, 3) scores.
    """
    first = [decoder.obj_score_token.weight] if hasattr(decoder, "obj_score_token") else []
    own = torch.cat([*first, decoder.iou_token.weight, decoder.mask_tokens.weight])
    tokens = torch.cat([own.expand(prompts.shape[0], -1, -1), prompts], dim=1)
    queries, pixels = two_way_attention(decoder.transformer, tokens, image)
    score_at = len(first)
    heads = decoder.output_hypernetworks_mlps
    filters = [heads[mask](queries[:, score_at + 1 + mask]) for mask in range(1, 1 + MASKS)]
    logits = predict_masks(decoder, pixels, image, torch.stack(filters, dim=2))
    return logits, decoder.iou_prediction_head(queries[:, score_at])[:, 1:]


def two_way_attention(
    transformer: Any,  # noqa: ANN401
    tokens: Tensor,
    image: ImageTokens,
) -> tuple[Tensor, Tensor]:
    """Let prompt tokens and image tokens attend to each other, layer by layer.

    Args:
        transformer: The decoder's two-way transformer.
        tokens: (N, T, dim) prompt tokens.
        image: The photo.

    Returns:
        (N, T, dim) prompt tokens and (N, P, dim) image tokens.
    """
    queries, pixels = tokens, image.tokens
    for number, layer in enumerate(transformer.layers):
        # In the first layer the queries are the prompts themselves: nothing to add them to.
        prompted = queries if layer.skip_first_layer_pe else queries + tokens
        mixed = _self_attention(layer.self_attn, prompted, queries)
        queries = layer.layer_norm1(mixed if layer.skip_first_layer_pe else queries + mixed)
        placed = pixels + image.positions
        to_image, to_token = layer.cross_attn_token_to_image, layer.cross_attn_image_to_token
        if number == 0:
            gathered = _first_token_to_image(to_image, queries + tokens, image)
        else:
            gathered = _token_to_image(to_image, queries + tokens, pixels, placed)
        queries = layer.layer_norm2(queries + gathered)
        queries = layer.layer_norm3(queries + layer.mlp(queries))
        keys = _by_head(to_token.k_proj(queries + tokens), to_token.num_attention_heads)
        keys = keys * to_token.scaling
        first = number == 0
        scores = _first_scores(keys, image) if first else _scores(to_token, keys, placed)
        pixels = layer.layer_norm4(_image_to_token(to_token, scores, queries, pixels))
    last = transformer.final_attn_token_to_image
    gathered = _token_to_image(last, queries + tokens, pixels, pixels + image.positions)
    return transformer.layer_norm_final_attn(queries + gathered), pixels


def _self_attention(attention: Any, queries: Tensor, values: Tensor) -> Tensor:  # noqa: ANN401
    mixed: Tensor = attention(query=queries[None], key=queries[None], value=values[None])[0][0]
    return mixed


def _first_token_to_image(attention: Any, queries: Tensor, image: ImageTokens) -> Tensor:  # noqa: ANN401
    """Attend from prompt tokens (N, T, dim) to the image tokens, which all points still share."""
    points, count, _ = queries.shape
    own = _by_head(attention.q_proj(queries).flatten(0, 1)[None], attention.num_attention_heads)
    keys, values = image.first_keys_values
    mixed = functional.scaled_dot_product_attention(own.transpose(1, 2), keys, values)
    out: Tensor = _output(attention)(mixed.transpose(1, 2).reshape(points, count, -1))
    return out


def _token_to_image(attention: Any, queries: Tensor, pixels: Tensor, placed: Tensor) -> Tensor:  # noqa: ANN401
    """Attend from prompt tokens (N, T, dim) to each point's own image tokens (N, P, dim)."""
    heads = attention.num_attention_heads
    own = _by_head(attention.q_proj(queries), heads) * attention.scaling
    # A bias of the keys would add the same to all of a query's scores: softmax ignores it.
    probes = torch.einsum("nthc,hcd->nthd", own, _rows_by_head(attention.k_proj.weight, heads))
    scores = torch.matmul(probes.flatten(1, 2), placed.transpose(1, 2))
    gathered = torch.unflatten(torch.matmul(scores.softmax(dim=2), pixels), 1, (-1, heads))
    values = torch.einsum("nthd,hcd->nthc", gathered, _rows_by_head(attention.v_proj.weight, heads))
    out: Tensor = _output(attention)(values.flatten(2) + attention.v_proj.bias)
    return out


def _first_scores(keys: Tensor, image: ImageTokens) -> Tensor:
    """Scores (N, P, T * heads) of prompt keys (N, T, heads, c) for the shared image tokens."""
    own = torch.eye(keys.shape[2], dtype=keys.dtype, device=keys.device)
    # One block a head: each head's queries meet that head's keys only.
    blocks = torch.einsum("nthc,hk->nhctk", keys, own).flatten(3).flatten(1, 2)
    return torch.matmul(image.first_queries, blocks)


def _scores(attention: Any, keys: Tensor, placed: Tensor) -> Tensor:  # noqa: ANN401
    """Scores (N, P, T * heads) of prompt keys for each point's own image tokens."""
    rows = _rows_by_head(attention.q_proj.weight, keys.shape[2])
    probes = torch.einsum("nthc,hcd->nthd", keys, rows).flatten(1, 2)
    shift = (keys * _rows_by_head(attention.q_proj.bias, keys.shape[2])).sum(dim=3).flatten(1)
    return torch.matmul(placed, probes.transpose(1, 2)) + shift[:, None]


def _image_to_token(attention: Any, scores: Tensor, queries: Tensor, pixels: Tensor) -> Tensor:  # noqa: ANN401
    """Add to the image tokens what they gather from the prompt tokens, (N, P, dim)."""
    heads, output = attention.num_attention_heads, _output(attention)
    shares = torch.unflatten(scores, 2, (-1, heads)).softmax(dim=2).flatten(2)
    values = _by_head(attention.v_proj(queries), heads)
    values = torch.einsum("nthc,dhc->nthd", values, torch.unflatten(output.weight, 1, (heads, -1)))
    values = values + output.bias / heads  # the shares of each head sum to 1
    return pixels + torch.matmul(shares, values.flatten(1, 2))


def _by_head(tokens: Tensor, heads: int) -> Tensor:
    split: Tensor = torch.unflatten(tokens, 2, (heads, -1))
    return split


def _rows_by_head(weight: Tensor, heads: int) -> Tensor:
    rows: Tensor = torch.unflatten(weight, 0, (heads, -1))
    return rows


def _output(attention: Any) -> Any:  # noqa: ANN401
    """The last projection, by either generation's name."""
    return attention.out_proj if hasattr(attention, "out_proj") else attention.o_proj


def predict_masks(
    decoder: Any,  # noqa: ANN401
    pixels: Tensor,
    image: ImageTokens,
    filters: Tensor,
) -> Tensor:
    """Upscale image tokens twice and weigh their channels, (N, 3, 4 S, 4 S) logits.

    A transposed convolution whose stride equals its kernel is one matrix product; channels stay
    last, so that nothing is moved before the masks are there.

    Args:
        decoder: The model's mask decoder.
        pixels: (N, P, dim) image tokens after attention.
        image: The photo.
        filters: (N, c, 3) channel weights of each mask.
    """
    norm, (bias, fine_bias) = decoder.upscale_layer_norm, image.upscale_biases
    fine = _upscale(pixels, decoder.upscale_conv1.weight) + bias
    fine = functional.layer_norm(fine, norm.normalized_shape, norm.weight, norm.bias, norm.eps)
    finest = _upscale(functional.gelu(fine), decoder.upscale_conv2.weight) + fine_bias
    logits = torch.matmul(functional.gelu(finest).flatten(1, 3), filters)
    side = image.side
    cells = logits.reshape(-1, side, side, 2, 2, 2, 2, MASKS)
    return cells.permute(0, 7, 1, 3, 5, 2, 4, 6).reshape(-1, MASKS, 4 * side, 4 * side)


def _upscale(cells: Tensor, weight: Tensor) -> Tensor:
    """Turn each cell into 2 x 2: (..., c) and a kernel (c, d, 2, 2) to (..., 4, d)."""
    return torch.unflatten(torch.matmul(cells, weight.permute(0, 2, 3, 1).flatten(1)), -1, (4, -1))


def _in_upscaled_order(features: Tensor, *, steps: int) -> Tensor:
    """Reorder features (c, H, W) as `_upscale` orders cells after some steps, (P, 4, .., c)."""
    channels, height, width = features.shape
    cells = 2**steps
    split = features.reshape(channels, height // cells, *[2] * steps, width // cells, *[2] * steps)
    rows = [2 + step for step in range(steps)]
    cols = [3 + steps + step for step in range(steps)]
    pairs = [axis for pair in zip(rows, cols, strict=True) for axis in pair]
    ordered = split.permute(1, 2 + steps, *pairs, 0)
    return ordered.reshape(height // cells * width // cells, *[4] * steps, channels)

// Blocked attention with online softmax [Milakov2018] [Dao2022] in f32, for any vector type V; included by
// one unit an instruction set, inside an anonymous namespace. V has kWidth lanes, kColumns vectors a register
// tile (kWidth · kColumns divides 64) and kRows rows a tile: kRows · kColumns accumulators + kColumns + 1
// registers. f32 error bound: as plain f32 attention, sums in tiles of kTileKeys.
//
// Memory a block: 24 KiB of scores and the block's O, in the first cache; K and V stream from the second.

/// Scores of R keys: s[r][lane] = Σ_d k[r][d] q[d][lane].
template <class V, int R>
inline __attribute__((always_inline)) void score_rows(const float* q, const float* k, int head_dim,
                                                      float* s) {
  V sum[R][V::kColumns];
  for (int r = 0; r < R; ++r)
    for (int c = 0; c < V::kColumns; ++c) sum[r][c] = V::zero();
  for (int d = 0; d < head_dim; ++d) {
    V lanes[V::kColumns];
    for (int c = 0; c < V::kColumns; ++c) lanes[c] = V::load(q + d * kLanes + c * V::kWidth);
#pragma GCC unroll 8
    for (int r = 0; r < R; ++r) {
      const V key = V::set1(k[r * head_dim + d]);
      for (int c = 0; c < V::kColumns; ++c) sum[r][c] = fma(key, lanes[c], sum[r][c]);
    }
  }
  for (int r = 0; r < R; ++r)
    for (int c = 0; c < V::kColumns; ++c) sum[r][c].store(s + r * kLanes + c * V::kWidth);
}

/// R rows of Oᵀ: out[r][lane] = out[r][lane] · decay[lane] + Σ_j v[j][r] p[j][lane].
template <class V, int R>
inline __attribute__((always_inline)) void value_rows(const float* p, const float* v, int num_keys,
                                                      int head_dim, const V* decay, bool first, float* out) {
  V sum[R][V::kColumns];
  for (int r = 0; r < R; ++r)
    for (int c = 0; c < V::kColumns; ++c) sum[r][c] = V::zero();
  for (int j = 0; j < num_keys; ++j) {
    V lanes[V::kColumns];
    for (int c = 0; c < V::kColumns; ++c) lanes[c] = V::load(p + j * kLanes + c * V::kWidth);
#pragma GCC unroll 8
    for (int r = 0; r < R; ++r) {
      const V value = V::set1(v[static_cast<int64_t>(j) * head_dim + r]);
      for (int c = 0; c < V::kColumns; ++c) sum[r][c] = fma(value, lanes[c], sum[r][c]);
    }
  }
  for (int r = 0; r < R; ++r)
    for (int c = 0; c < V::kColumns; ++c) {
      float* at = out + r * kLanes + c * V::kWidth;
      (first ? sum[r][c] : fma(V::load(at), decay[c], sum[r][c])).store(at);
    }
}

template <class V>
void attend_columns(const Block& block, int lane0) {
  constexpr int C = V::kColumns;
  const float* q = static_cast<const float*>(block.q) + lane0;
  float* s = block.scratch + lane0;
  float* out = block.out + lane0;
  const BiasedKey* biased = block.biased;
  const int d = block.head_dim;

  V largest[C], sum[C], decay[C];
  for (int c = 0; c < C; ++c) {
    largest[c] = V::set1(-__builtin_inff());
    sum[c] = V::zero();
    decay[c] = V::zero();
  }

  for (int64_t key0 = 0; key0 < block.num_keys; key0 += V::kTileKeys) {
    const int64_t left = block.num_keys - key0;
    const int tile = left < V::kTileKeys ? static_cast<int>(left) : V::kTileKeys;
    const float* k = static_cast<const float*>(block.k) + key0 * d;
    const float* v = static_cast<const float*>(block.v) + key0 * d;
    for_rows<V::kRows>(
        tile, [&]<int R>(int j) { score_rows<V, R>(q, k + static_cast<int64_t>(j) * d, d, s + j * kLanes); });

    for (; biased->key < key0 + tile; ++biased) {
      float* row = s + (biased->key - key0) * kLanes;
      const uint64_t lanes = biased->lanes >> lane0;
      for (int c = 0; c < C; ++c)
        add_in_lanes(row + c * V::kWidth, V::set1(block.beta), lanes >> (c * V::kWidth));
    }

    // New maxima; what was summed so far shrinks by decay. A maximum of -inf (no finite score yet) is lifted
    // to the least finite number, so that exp2(-inf - maximum) is 0 and not NaN.
    for (int c = 0; c < C; ++c) {
      V top = largest[c];
      for (int j = 0; j < tile; ++j) top = max_keeping_nan(V::load(s + j * kLanes + c * V::kWidth), top);
      top = max_keeping_nan(V::set1(-3.4028234e38f), top);
      decay[c] = exp2_nonpositive(largest[c] - top);
      largest[c] = top;
    }
    V tile_sum[C];
    for (int c = 0; c < C; ++c) tile_sum[c] = V::zero();
    for (int j = 0; j < tile; ++j)
      for (int c = 0; c < C; ++c) {
        float* at = s + j * kLanes + c * V::kWidth;
        const V p = exp2_nonpositive(V::load(at) - largest[c]);
        p.store(at);
        tile_sum[c] = tile_sum[c] + p;
      }
    for (int c = 0; c < C; ++c) sum[c] = fma(sum[c], decay[c], tile_sum[c]);

    for_rows<V::kRows>(d, [&]<int R>(int row) {
      value_rows<V, R>(s, v + row, tile, d, decay, key0 == 0, out + row * kLanes);
    });
  }

  for (int c = 0; c < C; ++c) {
    const V scale = V::set1(1.0f) / sum[c];
    for (int row = 0; row < d; ++row) {
      float* at = out + row * kLanes + c * V::kWidth;
      (V::load(at) * scale).store(at);
    }
    alignas(64) float top[V::kWidth], total[V::kWidth];
    largest[c].store(top);
    sum[c].store(total);
    for (int lane = 0; lane < V::kWidth; ++lane)
      block.log_sum_exp[lane0 + c * V::kWidth + lane] =
          (top[lane] + __builtin_log2f(total[lane])) * 0.693147181f;
  }
}

template <class V>
void attend(const Block& block) {
  for (int lane0 = 0; lane0 < block.num_lanes; lane0 += V::kWidth * V::kColumns)
    attend_columns<V>(block, lane0);
}

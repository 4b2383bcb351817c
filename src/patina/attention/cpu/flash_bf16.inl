// Blocked attention with online softmax on bf16 operands with f32 sums, for AVX-512 units; included inside
// their anonymous namespace after vec16.inl. `Products` multiplies: scores (Sᵀ = K Qᵀ, f32) and values (Oᵀ =
// Vᵀ Pᵀ). The softmax is f32; probabilities are rounded to bf16 for the second product, as any bf16 attention
// rounds them, and summed before rounding.

/// Two rows of 16 probabilities -> 16 pairs of bf16, the even row in the lower half.
inline __attribute__((always_inline)) __m512i bf16_pairs(Vec16 even, Vec16 odd) {
  const __m512i packed = reinterpret_cast<__m512i>(_mm512_cvtne2ps_pbh(odd.v, even.v));
  const __m512i order = _mm512_set_epi16(31, 15, 30, 14, 29, 13, 28, 12, 27, 11, 26, 10, 25, 9, 24, 8, 23, 7,
                                         22, 6, 21, 5, 20, 4, 19, 3, 18, 2, 17, 1, 16, 0);
  return _mm512_permutexvar_epi16(order, packed);
}

/// Scores of one tile to probabilities: fills p [tile rounded up to kKeyStep / 2][64] pairs, updates largest
/// and sum, returns decay. Scores and maxima are unscaled products; the difference of two is scaled. One
/// vector of lanes at a time, so that maximum and sum stay in registers.
template <int kKeyStep>
inline Vec16 softmax_tile(const float* s, int tile, Vec16 scale, Vec16& largest, Vec16& sum, uint32_t* p) {
  Vec16 top0 = largest, top1 = largest;
  int j = 0;
  for (; j + 2 <= tile; j += 2) {
    top0 = max_keeping_nan(Vec16::load(s + j * kLanes), top0);
    top1 = max_keeping_nan(Vec16::load(s + (j + 1) * kLanes), top1);
  }
  if (j < tile) top0 = max_keeping_nan(Vec16::load(s + j * kLanes), top0);
  // A maximum of -inf (no finite score yet) is lifted, so that exp2(-inf - maximum) is 0 and not NaN.
  const Vec16 top = max_keeping_nan(Vec16::set1(-3.4028234e38f), max_keeping_nan(top0, top1));
  const Vec16 decay = exp2_nonpositive((largest - top) * scale);
  largest = top;

  Vec16 sum0 = Vec16::zero(), sum1 = Vec16::zero();
  for (j = 0; j + 2 <= tile; j += 2) {
    const Vec16 even = exp2_nonpositive((Vec16::load(s + j * kLanes) - top) * scale);
    const Vec16 odd = exp2_nonpositive((Vec16::load(s + (j + 1) * kLanes) - top) * scale);
    sum0 = sum0 + even;
    sum1 = sum1 + odd;
    _mm512_store_si512(p + j / 2 * kLanes, bf16_pairs(even, odd));
  }
  if (j < tile) {
    const Vec16 even = exp2_nonpositive((Vec16::load(s + j * kLanes) - top) * scale);
    sum0 = sum0 + even;
    _mm512_store_si512(p + j / 2 * kLanes, bf16_pairs(even, Vec16::zero()));
    j += 2;
  }
  for (; j % kKeyStep != 0; j += 2) _mm512_store_si512(p + j / 2 * kLanes, _mm512_setzero_si512());
  sum = fma(sum, decay, sum0 + sum1);
  return decay;
}

template <class Products>
void attend_bf16(const Block& block) {
  constexpr int C = 4;
  const Products products(block.head_dim);
  float* s = block.scratch;
  uint32_t* p = reinterpret_cast<uint32_t*>(s + kTileKeysMax * kLanes);
  const BiasedKey* biased = block.biased;
  const Vec16 scale = Vec16::set1(block.score_scale);
  const float beta = block.beta / block.score_scale;  // in units of the products

  Vec16 largest[C], sum[C], decay[C];
  for (int c = 0; c < C; ++c) {
    largest[c] = Vec16::set1(-__builtin_inff());
    sum[c] = Vec16::zero();
  }
  const int columns = (block.num_lanes + 15) / 16;  // the others are not read back

  for (int64_t key0 = 0; key0 < block.num_keys; key0 += Products::kTileKeys) {
    const int64_t left = block.num_keys - key0;
    const int tile = left < Products::kTileKeys ? static_cast<int>(left) : Products::kTileKeys;
    products.scores(block, key0, tile, s);
    for (; biased->key < key0 + tile; ++biased) {
      float* row = s + (biased->key - key0) * kLanes;
      for (int c = 0; c < C; ++c) add_in_lanes(row + c * 16, Vec16::set1(beta), biased->lanes >> (c * 16));
    }
    for (int c = 0; c < columns; ++c)
      decay[c] = softmax_tile<Products::kKeyStep>(s + c * 16, tile, scale, largest[c], sum[c], p + c * 16);
    for (int c = columns; c < C; ++c) {
      decay[c] = Vec16::zero();
      for (int j = 0; j < tile || j % Products::kKeyStep != 0; j += 2)
        _mm512_store_si512(p + j / 2 * kLanes + c * 16, _mm512_setzero_si512());
    }
    products.values(block, key0, tile, p, decay, key0 == 0, s);
  }

  for (int c = 0; c < columns; ++c) {
    const Vec16 inverse = Vec16::set1(1.0f) / sum[c];
    for (int row = 0; row < block.head_dim; ++row) {
      float* at = block.out + row * kLanes + c * 16;
      (Vec16::load(at) * inverse).store(at);
    }
    alignas(64) float top[16], total[16];
    largest[c].store(top);
    sum[c].store(total);
    for (int lane = 0; lane < 16; ++lane)
      block.log_sum_exp[c * 16 + lane] =
          (top[lane] * block.score_scale + __builtin_log2f(total[lane])) * 0.693147181f;
  }
}

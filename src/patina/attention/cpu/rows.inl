// Rows in groups of a register tile; included by each kernel unit inside its anonymous namespace.

template <int R, class F>
inline __attribute__((always_inline)) void last_rows(int row, int left, const F& f) {
  if constexpr (R > 0) {
    if (left == R)
      f.template operator()<R>(row);
    else
      last_rows<R - 1>(row, left, f);
  }
}

/// Calls f.operator()<R>(row) over rows [0, count) in groups of kRows, then one smaller group of what is
/// left.
template <int kRows, class F>
inline __attribute__((always_inline)) void for_rows(int count, const F& f) {
  int row = 0;
  for (; row + kRows <= count; row += kRows) f.template operator()<kRows>(row);
  last_rows<kRows - 1>(row, count - row, f);
}

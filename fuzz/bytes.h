// Takes numbers and choices from the front of a target's bytes; zeros when they are used up.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

namespace patina::fuzz {

class Bytes {
 public:
  explicit Bytes(std::span<const uint8_t> bytes) : bytes_(bytes) {}

  bool is_empty() const { return bytes_.empty(); }
  std::span<const uint8_t> rest() const { return bytes_; }

  uint8_t byte() {
    if (bytes_.empty()) return 0;
    const uint8_t value = bytes_.front();
    bytes_ = bytes_.subspan(1);
    return value;
  }
  uint32_t number16() { return static_cast<uint32_t>(byte() << 8) | byte(); }
  /// One of `choices`.
  template <class Choices>
  const auto& one_of(const Choices& choices) {
    return choices[byte() % std::size(choices)];
  }
  /// The bytes up to the next zero or the end; the zero is passed over.
  std::string_view text() {
    const std::string_view all(reinterpret_cast<const char*>(bytes_.data()), bytes_.size());
    const std::string_view found = all.substr(0, all.find('\0'));
    bytes_ = bytes_.subspan(found.size() < all.size() ? found.size() + 1 : found.size());
    return found;
  }

 private:
  std::span<const uint8_t> bytes_;
};

}  // namespace patina::fuzz

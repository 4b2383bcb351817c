// Weight files in the safetensors format: reading in place through a memory map, and writing. No Torch here.
// Layout: u64 little endian header length, a JSON object name -> {dtype, shape, data_offsets}, then the data.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "patina/base/files.h"

namespace patina::nn {

enum class ElementType {
  kBool,
  kU8,
  kI8,
  kF8E5M2,
  kF8E4M3,
  kI16,
  kU16,
  kF16,
  kBF16,
  kI32,
  kU32,
  kF32,
  kF64,
  kI64,
  kU64
};

/// The format's own name ("F32") and the size of one element.
std::string_view name_of(ElementType type);
int64_t bytes_of(ElementType type);

/// "[320, 4, 3, 3]", for messages.
std::string shape_text(std::span<const int64_t> shape);

/// A tensor as it lies in a file; `bytes` are little endian, row-major, without holes, of any alignment.
struct TensorEntry {
  std::string name;
  ElementType type = ElementType::kF32;
  std::vector<int64_t> shape;
  std::span<const uint8_t> bytes;

  int64_t num_elements() const { return static_cast<int64_t>(bytes.size()) / bytes_of(type); }
};

/// A whole file, checked: every tensor's bytes lie in the data, follow each other without hole or overlap,
/// and are as many as dtype and shape say. Nothing larger than the header is allocated.
class SafeTensors {
 public:
  /// Throws Error{kFormat} with the file (and tensor), what was expected and what was found; a pickle, zip or
  /// GGUF file is refused by name, with the reason.
  explicit SafeTensors(const std::filesystem::path& path);
  SafeTensors(SafeTensors&&) = default;
  SafeTensors& operator=(SafeTensors&&) = default;

  const std::filesystem::path& path() const { return file_->path(); }
  /// In the order of their data.
  const std::vector<TensorEntry>& tensors() const { return tensors_; }
  /// Null if there is no such tensor.
  const TensorEntry* find(std::string_view name) const;
  const std::map<std::string, std::string>& metadata() const { return metadata_; }
  /// Keeps the mapped pages alive for those who hold on to `bytes`.
  const std::shared_ptr<const MappedFile>& file() const { return file_; }

 private:
  std::shared_ptr<const MappedFile> file_;
  std::vector<TensorEntry> tensors_;
  std::map<std::string_view, size_t> index_;
  std::map<std::string, std::string> metadata_;
};

/// Throws Error{kUnsupported} that names file, tensor and type unless its elements are F32, F16, BF16 or F64.
void require_float(const SafeTensors& file, const TensorEntry& entry);

/// Throws Error{kUnsupported} with the reason if the path's name is that of a pickled checkpoint (.ckpt .pth
/// .pt .bin .pkl).
void refuse_pickle_name(const std::filesystem::path& path);

/// A tensor that is yet to be written.
struct TensorPlan {
  std::string name;
  ElementType type = ElementType::kF32;
  std::vector<int64_t> shape;
};

/// Writes the tensors in the given order, atomically; the data begins at a multiple of 64 bytes.
void write_safetensors(const std::filesystem::path& path, std::span<const TensorEntry> tensors,
                       const std::map<std::string, std::string>& metadata = {});
/// The same one tensor at a time, for files larger than memory: `fill` gives each tensor's bytes into a
/// buffer of its size. Without `fill` the data are zeros that take no place on disk.
void write_safetensors(const std::filesystem::path& path, std::span<const TensorPlan> tensors,
                       const std::function<void(const TensorPlan&, std::span<uint8_t>)>& fill,
                       const std::map<std::string, std::string>& metadata = {});

}  // namespace patina::nn

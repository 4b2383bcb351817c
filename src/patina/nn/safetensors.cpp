#include "patina/nn/safetensors.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <fstream>
#include <limits>
#include <optional>

#include <nlohmann/json.hpp>

#include "patina/base/check.h"
#include "patina/base/error.h"

namespace patina::nn {
namespace {

static_assert(std::endian::native == std::endian::little, "weights are used as they lie in the file");

constexpr uint64_t kMaxHeaderBytes = 100'000'000;  // the format's own limit
constexpr std::string_view kPickleReason =
    "is a Python pickle, which runs code of its author when it is loaded; patina reads only .safetensors "
    "(convert it once, in a sandbox, with the tools of its source)";

struct TypeRow {
  ElementType type;
  std::string_view name;
  int64_t bytes;
};
constexpr std::array kTypes{
    TypeRow{ElementType::kBool, "BOOL", 1},      TypeRow{ElementType::kU8, "U8", 1},
    TypeRow{ElementType::kI8, "I8", 1},          TypeRow{ElementType::kF8E5M2, "F8_E5M2", 1},
    TypeRow{ElementType::kF8E4M3, "F8_E4M3", 1}, TypeRow{ElementType::kI16, "I16", 2},
    TypeRow{ElementType::kU16, "U16", 2},        TypeRow{ElementType::kF16, "F16", 2},
    TypeRow{ElementType::kBF16, "BF16", 2},      TypeRow{ElementType::kI32, "I32", 4},
    TypeRow{ElementType::kU32, "U32", 4},        TypeRow{ElementType::kF32, "F32", 4},
    TypeRow{ElementType::kF64, "F64", 8},        TypeRow{ElementType::kI64, "I64", 8},
    TypeRow{ElementType::kU64, "U64", 8}};

/// A name from the file as messages show it. (Appending instead of "'" + text: GCC 12 warns falsely about the
/// latter.)
std::string quoted(std::string_view name, size_t max_length = 80) {
  std::string text(1, '\'');
  text.append(printable(name, max_length)).push_back('\'');
  return text;
}
std::string tensor_label(std::string_view name) {
  return std::string("tensor ").append(quoted(name));
}

const TypeRow& row_of(ElementType type) {
  return kTypes[static_cast<size_t>(type)];
}

/// What the header says about one tensor, before it is checked against the file.
struct Declared {
  std::string name;
  std::optional<ElementType> type;
  std::optional<std::vector<uint64_t>> shape;
  std::optional<std::vector<uint64_t>> offsets;
};

/// Reads the header as a stream of events, so that duplicate keys are seen, nothing is nested deeper than a
/// header is, and a header of any kind costs memory in proportion to its tensors only.
class HeaderParser : public nlohmann::json_sax<nlohmann::json> {
 public:
  std::vector<Declared> tensors;
  std::map<std::string, std::string> metadata;
  std::string fault;  // empty while all is well

  bool null() override { return value("null"); }
  bool boolean(bool) override { return value("a boolean"); }
  bool number_integer(number_integer_t) override { return value("a negative number"); }
  bool number_float(number_float_t, const string_t& text) override {
    return value("the number " + printable(text, 40));
  }
  bool binary(binary_t&) override { return value("binary data"); }
  bool number_unsigned(number_unsigned_t number) override {
    if (place_ != Place::kShape && place_ != Place::kOffsets) return value("a number");
    auto& list = place_ == Place::kShape ? *tensors.back().shape : *tensors.back().offsets;
    if (list.size() >= 64) return fail(field_text() + " has more than 64 entries");
    list.push_back(number);
    return true;
  }
  bool string(string_t& text) override {
    if (place_ == Place::kMetadata) {
      if (!metadata.emplace(field_, text).second)
        return fail("__metadata__ names '" + printable(field_) + "' twice");
      return true;
    }
    if (place_ != Place::kTensor || field_ != "dtype") return value("a string");
    const auto row =
        std::find_if(kTypes.begin(), kTypes.end(), [&](const TypeRow& t) { return t.name == text; });
    if (row == kTypes.end()) {
      return fail(tensor_text() + " has the dtype '" + printable(text, 40) +
                  "', expected one of F32, F16, BF16, F64, I64, "
                  "I32, I16, I8, U64, U32, U16, U8, BOOL, F8_E5M2, F8_E4M3");
    }
    tensors.back().type = row->type;
    return true;
  }
  bool start_object(size_t) override {
    if (place_ == Place::kStart) {
      place_ = Place::kNames;
    } else if (place_ == Place::kNames) {
      place_ = in_metadata_ ? Place::kMetadata : Place::kTensor;
      fields_seen_ = 0;
    } else {
      return value("an object");
    }
    return true;
  }
  bool end_object() override {
    place_ = place_ == Place::kNames ? Place::kEnd : Place::kNames;
    return true;
  }
  bool key(string_t& name) override {
    if (place_ == Place::kNames) {
      in_metadata_ = name == "__metadata__";
      if (in_metadata_ && metadata_seen_) return fail("__metadata__ is given twice");
      metadata_seen_ = metadata_seen_ || in_metadata_;
      if (!in_metadata_) tensors.push_back({std::move(name), {}, {}, {}});
      return true;
    }
    field_ = std::move(name);
    if (place_ == Place::kMetadata) return true;
    const int field = field_ == "dtype" ? 1 : field_ == "shape" ? 2 : field_ == "data_offsets" ? 4 : 0;
    if (field == 0) return fail(tensor_text() + " has the unknown field '" + printable(field_, 40) + "'");
    if (fields_seen_ & field) return fail(tensor_text() + " gives '" + field_ + "' twice");
    fields_seen_ |= field;
    return true;
  }
  bool start_array(size_t) override {
    if (place_ == Place::kTensor && field_ == "shape") {
      place_ = Place::kShape;
      tensors.back().shape.emplace();
    } else if (place_ == Place::kTensor && field_ == "data_offsets") {
      place_ = Place::kOffsets;
      tensors.back().offsets.emplace();
    } else {
      return value("an array");
    }
    return true;
  }
  bool end_array() override {
    place_ = Place::kTensor;
    return true;
  }
  bool parse_error(size_t position, const std::string&, const nlohmann::json::exception& error) override {
    // Overflowing numbers and bad UTF-8 arrive here too; the text behind the last ';' or ']' of the library
    // is the reason.
    return fail("the header is not valid JSON at byte " + std::to_string(position) + ": " +
                printable(error.what(), 160));
  }

 private:
  enum class Place { kStart, kNames, kTensor, kMetadata, kShape, kOffsets, kEnd };

  bool fail(std::string text) {
    fault = std::move(text);
    return false;
  }
  std::string tensor_text() const { return tensor_label(tensors.back().name); }
  std::string field_text() const { return quoted(field_, 40) + " of " + tensor_text(); }
  /// A value that its place does not take.
  bool value(const std::string& found) {
    switch (place_) {
      case Place::kStart:
        return fail("the header is " + found + ", expected an object of tensors");
      case Place::kMetadata:
        return fail("__metadata__ '" + printable(field_, 40) + "' is " + found + ", expected a string");
      case Place::kShape:
      case Place::kOffsets:
        return fail(field_text() + " holds " + found + ", expected unsigned integers");
      case Place::kTensor:
        return fail(field_text() + " is " + found + ", expected " +
                    (field_ == "dtype" ? "a string" : "an array of unsigned integers"));
      default:
        return fail((in_metadata_ ? std::string("__metadata__") : tensor_text()) + " is " + found +
                    ", expected an object");
    }
  }

  Place place_ = Place::kStart;
  bool in_metadata_ = false, metadata_seen_ = false;
  int fields_seen_ = 0;
  std::string field_;
};

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& message) {
  throw Error(ErrorCode::kFormat, path.string(), message);
}

bool begins_with(std::span<const uint8_t> bytes, std::string_view magic) {
  return bytes.size() >= magic.size() && std::memcmp(bytes.data(), magic.data(), magic.size()) == 0;
}

/// Other formats that come under this name, told from their first bytes.
void refuse_other_formats(const std::filesystem::path& path, std::span<const uint8_t> bytes) {
  if (begins_with(bytes, "GGUF")) {
    throw Error(ErrorCode::kUnsupported, path.string(),
                "is a GGUF file (quantised weights of llama.cpp's kin), expected safetensors");
  }
  if (begins_with(bytes, "PK\x03\x04") || begins_with(bytes, "PK\x05\x06")) {
    throw Error(ErrorCode::kUnsupported, path.string(),
                "is a zip archive; if it is a PyTorch checkpoint it holds a Python pickle, which runs code "
                "of its author "
                "when it is loaded; patina reads only .safetensors");
  }
  if (bytes.size() >= 2 && bytes[0] == 0x80 && bytes[1] >= 2 && bytes[1] <= 5 && bytes.back() == '.') {
    throw Error(ErrorCode::kUnsupported, path.string(), std::string(kPickleReason));
  }
}

/// Number of elements; nullopt if it does not fit into 63 bits.
template <class Integer>
std::optional<uint64_t> element_count(const std::vector<Integer>& shape) {
  uint64_t count = 1;
  for (const auto size : shape) {
    if (static_cast<uint64_t>(size) > static_cast<uint64_t>(std::numeric_limits<int64_t>::max()))
      return std::nullopt;
    if (__builtin_mul_overflow(count, static_cast<uint64_t>(size), &count)) return std::nullopt;
  }
  if (count > static_cast<uint64_t>(std::numeric_limits<int64_t>::max())) return std::nullopt;
  return count;
}

/// The tensor with its bytes, or a failure that names what does not fit.
TensorEntry checked_entry(const std::filesystem::path& path, Declared&& declared,
                          std::span<const uint8_t> data) {
  const std::string tensor = tensor_label(declared.name);
  if (!declared.type) fail(path, tensor + " has no dtype");
  if (!declared.shape) fail(path, tensor + " has no shape");
  if (!declared.offsets) fail(path, tensor + " has no data_offsets");
  if (declared.offsets->size() != 2) {
    fail(path, tensor + " has " + std::to_string(declared.offsets->size()) +
                   " data_offsets, expected 2 (begin, end)");
  }
  const uint64_t begin = (*declared.offsets)[0], end = (*declared.offsets)[1];
  const std::string range = "[" + std::to_string(begin) + ", " + std::to_string(end) + ")";
  if (begin > end) fail(path, tensor + " has the data_offsets " + range + ", which end before they begin");
  if (end > data.size()) {
    fail(path, tensor + " lies at " + range + " of the data, but the file holds " +
                   std::to_string(data.size()) + " bytes of data: it is truncated or its header is wrong");
  }
  const std::optional<uint64_t> count = element_count(*declared.shape);
  uint64_t expected = 0;
  if (!count || __builtin_mul_overflow(*count, static_cast<uint64_t>(bytes_of(*declared.type)), &expected)) {
    fail(path, tensor + " has a shape whose number of elements overflows");
  }
  TensorEntry entry{std::move(declared.name),
                    *declared.type,
                    {declared.shape->begin(), declared.shape->end()},
                    data.subspan(begin, end - begin)};
  if (expected != end - begin) {
    fail(path, tensor + " of shape " + shape_text(entry.shape) + " " + std::string(name_of(entry.type)) +
                   " needs " + std::to_string(expected) + " bytes, but its data_offsets hold " +
                   std::to_string(end - begin));
  }
  return entry;
}

}  // namespace

std::string_view name_of(ElementType type) {
  return row_of(type).name;
}
int64_t bytes_of(ElementType type) {
  return row_of(type).bytes;
}

std::string shape_text(std::span<const int64_t> shape) {
  std::string text = "[";
  for (size_t i = 0; i < shape.size(); ++i) text += (i ? ", " : "") + std::to_string(shape[i]);
  return text + "]";
}

void refuse_pickle_name(const std::filesystem::path& path) {
  const std::string extension = path.extension().string();
  for (const std::string_view pickle : {".ckpt", ".pth", ".pt", ".bin", ".pkl"}) {
    if (extension == pickle) throw Error(ErrorCode::kUnsupported, path.string(), std::string(kPickleReason));
  }
}

SafeTensors::SafeTensors(const std::filesystem::path& path) {
  refuse_pickle_name(path);
  file_ = std::make_shared<MappedFile>(path);
  const std::span<const uint8_t> bytes = file_->bytes();
  refuse_other_formats(path, bytes);

  // The header's bounds.
  if (bytes.size() < 8)
    fail(path, "is " + std::to_string(bytes.size()) + " bytes long, too short for a safetensors file");
  uint64_t header_bytes = 0;
  std::memcpy(&header_bytes, bytes.data(), 8);
  if (header_bytes > kMaxHeaderBytes) {
    fail(path, "gives its header " + std::to_string(header_bytes) +
                   " bytes, more than the format's limit of " + std::to_string(kMaxHeaderBytes) +
                   ": it is not a safetensors file, or it is damaged");
  }
  if (header_bytes > bytes.size() - 8) {
    fail(path, "gives its header " + std::to_string(header_bytes) + " bytes, but only " +
                   std::to_string(bytes.size() - 8) + " follow: it is truncated, or not a safetensors file");
  }
  const std::span<const uint8_t> header = bytes.subspan(8, header_bytes);
  const std::span<const uint8_t> data = bytes.subspan(8 + header_bytes);
  if (header.empty() || header.front() != '{')
    fail(path, "its header does not begin with '{': it is not a safetensors file, or it is damaged");

  HeaderParser parser;
  if (!nlohmann::json::sax_parse(header.begin(), header.end(), &parser)) fail(path, parser.fault);
  metadata_ = std::move(parser.metadata);

  // The tensors, in the order of their data, which they must fill.
  tensors_.reserve(parser.tensors.size());
  for (Declared& declared : parser.tensors)
    tensors_.push_back(checked_entry(path, std::move(declared), data));
  std::stable_sort(tensors_.begin(), tensors_.end(), [](const TensorEntry& a, const TensorEntry& b) {
    return std::pair(a.bytes.data(), a.bytes.size()) < std::pair(b.bytes.data(), b.bytes.size());
  });
  for (size_t i = 0; i < tensors_.size(); ++i) {
    if (!index_.emplace(tensors_[i].name, i).second)
      fail(path, tensor_label(tensors_[i].name) + " is given twice");
  }
  uint64_t position = 0;
  for (size_t i = 0; i < tensors_.size(); ++i) {
    const auto begin = static_cast<uint64_t>(tensors_[i].bytes.data() - data.data());
    const std::string tensor = tensor_label(tensors_[i].name);
    if (begin < position) {
      fail(path, tensor + " begins at byte " + std::to_string(begin) + " of the data and overlaps '" +
                     printable(tensors_[i - 1].name, 80) + "', which ends at " + std::to_string(position));
    }
    if (begin > position) {
      fail(path, "there is a hole of " + std::to_string(begin - position) + " bytes before " + tensor);
    }
    position = begin + tensors_[i].bytes.size();
  }
  if (position != data.size()) {
    fail(path, std::to_string(data.size() - position) + " bytes follow the last tensor, expected none");
  }
}

const TensorEntry* SafeTensors::find(std::string_view name) const {
  const auto found = index_.find(name);
  return found == index_.end() ? nullptr : &tensors_[found->second];
}

namespace {

/// Length field and header, padded so that the data begin at a multiple of 64 bytes; and the bytes that the
/// data take.
std::pair<std::string, uint64_t> header_of(std::span<const TensorPlan> tensors,
                                           const std::map<std::string, std::string>& metadata) {
  nlohmann::ordered_json header = nlohmann::ordered_json::object();
  if (!metadata.empty()) header["__metadata__"] = metadata;
  uint64_t position = 0;
  for (const TensorPlan& tensor : tensors) {
    const std::optional<uint64_t> count = element_count(tensor.shape);
    PATINA_CHECK(count.has_value());
    PATINA_CHECK(!header.contains(tensor.name));
    const uint64_t end = position + *count * static_cast<uint64_t>(bytes_of(tensor.type));
    header[tensor.name] = {
        {"dtype", name_of(tensor.type)}, {"shape", tensor.shape}, {"data_offsets", {position, end}}};
    position = end;
  }
  std::string text = header.dump();
  text.append((64 - (8 + text.size()) % 64) % 64, ' ');
  const uint64_t header_bytes = text.size();
  std::string length(8, '\0');
  std::memcpy(length.data(), &header_bytes, 8);
  return {length + text, position};
}

}  // namespace

void write_safetensors(const std::filesystem::path& path, std::span<const TensorEntry> tensors,
                       const std::map<std::string, std::string>& metadata) {
  std::vector<TensorPlan> plans;
  for (const TensorEntry& tensor : tensors) plans.push_back({tensor.name, tensor.type, tensor.shape});
  size_t next = 0;
  const auto copy = [&](const TensorPlan&, std::span<uint8_t> bytes) {
    const TensorEntry& tensor = tensors[next++];
    PATINA_CHECK_EQ(tensor.bytes.size(), bytes.size());
    std::copy(tensor.bytes.begin(), tensor.bytes.end(), bytes.begin());
  };
  write_safetensors(path, plans, copy, metadata);
}

void write_safetensors(const std::filesystem::path& path, std::span<const TensorPlan> tensors,
                       const std::function<void(const TensorPlan&, std::span<uint8_t>)>& fill,
                       const std::map<std::string, std::string>& metadata) {
  const auto planned = header_of(tensors, metadata);
  const std::string& header = planned.first;  // clang 14 captures no structured bindings
  const uint64_t data_bytes = planned.second;
  write_file_with(path, [&](const std::filesystem::path& temporary) {
    std::ofstream file(temporary, std::ios::binary | std::ios::trunc);
    const auto write = [&](const void* bytes, size_t size) {
      file.write(static_cast<const char*>(bytes), static_cast<std::streamsize>(size));
    };
    write(header.data(), header.size());
    std::vector<uint8_t> buffer;
    for (const TensorPlan& tensor : tensors) {
      if (!fill) break;
      buffer.assign(*element_count(tensor.shape) * static_cast<uint64_t>(bytes_of(tensor.type)), 0);
      fill(tensor, buffer);
      write(buffer.data(), buffer.size());
    }
    file.close();
    if (!file) throw Error(ErrorCode::kIo, path.string(), "cannot be written; is the disk full?");
    std::filesystem::resize_file(temporary, header.size() + data_bytes);
  });
}

void require_float(const SafeTensors& file, const TensorEntry& entry) {
  switch (entry.type) {
    case ElementType::kF16:
    case ElementType::kBF16:
    case ElementType::kF32:
    case ElementType::kF64:
      return;
    default:
      throw Error(ErrorCode::kUnsupported, file.path().string(),
                  "tensor " + printable(entry.name, 80) + " holds " + std::string(name_of(entry.type)) +
                      ", expected weights of F32, F16 or BF16");
  }
}

}  // namespace patina::nn

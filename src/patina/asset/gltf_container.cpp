#include "patina/asset/gltf_container.h"

#include <algorithm>
#include <cstring>
#include <set>

#include <fmt/format.h>

#include "patina/asset/extensions.h"
#include "patina/asset/meshopt_views.h"
#include "patina/asset/uri.h"
#include "patina/base/files.h"

namespace patina::asset {
namespace {

uint32_t little_u32(std::span<const uint8_t> b, size_t at) {
  return uint32_t{b[at + 3]} << 24 | uint32_t{b[at + 2]} << 16 | uint32_t{b[at + 1]} << 8 | b[at];
}

constexpr uint32_t kJsonChunk = 0x4E4F534A, kBinChunk = 0x004E4942;

void split_glb(SourceDocument& d, std::vector<std::string>& warnings) {
  const std::span<const uint8_t> file = d.file;
  const auto fail = [&](const std::string& message) { throw Error(ErrorCode::kFormat, d.name, message); };
  if (file.size() < 12) fail("the GLB file is cut short inside its header");
  if (const uint32_t version = little_u32(file, 4); version != 2)
    throw Error(ErrorCode::kUnsupported, d.name,
                fmt::format("the GLB container has version {}, expected 2", version));
  const uint64_t length = little_u32(file, 8);
  if (length > file.size())
    fail(fmt::format("the GLB header says {} bytes, the file has {}: it is cut short", length, file.size()));
  if (length < file.size())
    warnings.push_back(fmt::format("{} bytes after the end of the GLB are ignored", file.size() - length));
  bool has_json = false, has_bin = false;
  for (uint64_t at = 12; at < length;) {
    if (length - at < 8) fail("the GLB file ends inside a chunk header");
    const uint64_t size = little_u32(file, at);
    const uint32_t type = little_u32(file, at + 4);
    if (size > length - at - 8)
      fail(fmt::format("a GLB chunk of {} bytes reaches past the end of the file", size));
    const uint64_t begin = at + 8, end = begin + size;
    if (!has_json && type != kJsonChunk) fail("the first chunk of the GLB is not JSON");
    if (type == kJsonChunk && !has_json) {
      has_json = true;
      d.json_begin = begin, d.json_end = end;
    } else if (type == kBinChunk && !has_bin) {
      has_bin = true;
      d.bin_begin = begin, d.bin_end = end;
    } else {
      warnings.push_back("a further chunk of the GLB is ignored");
    }
    at = end + (end % 4 ? std::min<uint64_t>(4 - end % 4, length - end) : 0);
  }
  if (!has_json || d.json_begin == d.json_end) fail("the GLB file has no JSON chunk");
  while (d.json_end > d.json_begin && d.file[d.json_end - 1] == ' ') --d.json_end;  // the chunk's padding
}

void check_asset_and_extensions(const SourceDocument& d) {
  const JsonView root = d.root();
  const JsonView asset = root.at("asset");
  const auto version_of = [&](const JsonView& v) {
    const std::string text = v.json().is_number() ? fmt::format("{:.1f}", v.number()) : v.string();
    int major = 0, minor = 0;
    if (std::sscanf(text.c_str(), "%d.%d", &major, &minor) != 2)
      v.fail("expected a version such as 2.0, found '" + printable(text, 20) + "'");
    return std::pair(major, minor);
  };
  const JsonView version = asset.at("version");
  if (version_of(version).first != 2)
    version.fail(
        fmt::format(
            "glTF version is {}, expected 2.0",
            printable(version.json().dump(-1, ' ', false, nlohmann::json::error_handler_t::replace), 20)),
        ErrorCode::kUnsupported);
  if (const auto needed = asset.find("minVersion"); needed && version_of(*needed) > std::pair(2, 0))
    needed->fail("the file needs a newer glTF version than 2.0", ErrorCode::kUnsupported);
  if (const auto required = root.find("extensionsRequired"))
    for (size_t i = 0; i < required->size(); ++i) {
      const std::string& name = (*required)[i].string();
      const ExtensionRow* row = find_extension(name);
      if (!row || row->use == ExtensionUse::kRefused)
        (*required)[i].fail(fmt::format("the file requires the extension {}, which patina does not read; {}",
                                        printable(name, 80), row ? row->remark : "export it without"),
                            ErrorCode::kUnsupported);
    }
}

// Names what the file uses and the views do not show. Extensions of materials are named with their material.
void note_extensions(const SourceDocument& d, std::vector<std::string>& warnings) {
  std::set<std::string> of_materials;
  if (const auto materials = d.json.find("materials"); materials != d.json.end() && materials->is_array())
    for (const auto& material : *materials)
      if (material.is_object() && material.contains("extensions") && material["extensions"].is_object())
        for (const auto& [name, unused] : material["extensions"].items()) of_materials.insert(name);
  for (const std::string& name : extensions_in(d.json)) {
    const ExtensionRow* row = find_extension(name);
    if (of_materials.contains(name) ||
        (row && (row->use == ExtensionUse::kObeyed || row->use == ExtensionUse::kCarriedOver)))
      continue;
    warnings.push_back(fmt::format("the file uses the extension {}, which is carried over: {}",
                                   printable(name, 80), row ? row->remark : "patina does not know it"));
  }
}

void load_buffers(SourceDocument& d) {
  const auto buffers = d.root().find("buffers");
  if (!buffers) return;
  d.buffers.resize(buffers->size());
  for (size_t i = 0; i < buffers->size(); ++i) {
    const JsonView buffer = (*buffers)[i];
    SourceBuffer& out = d.buffers[i];
    const auto length = static_cast<uint64_t>(buffer.at("byteLength").integer(1, int64_t{1} << 40));
    std::span<const uint8_t> found;
    if (const auto uri = buffer.find("uri")) {
      const std::string& text = uri->string();
      if (is_data_uri(text)) {
        out.owned = decode_data_uri(text, uri->where());
      } else {
        out.reference = percent_decoded(text, uri->where());
        const auto path = resolve_inside(d.folder(), out.reference, uri->where());
        try {
          out.owned = read_file(path);
        } catch (const Error& e) {
          uri->fail(fmt::format("the buffer file '{}' {}", printable(out.reference),
                                e.code() == ErrorCode::kNotFound ? "does not exist" : e.message()),
                    e.code());
        }
      }
      found = out.owned;
    } else if (i == 0 && d.bin_end > d.bin_begin) {
      found = std::span<const uint8_t>(d.file).subspan(d.bin_begin, d.bin_end - d.bin_begin);
    } else {
      continue;  // only an extension could fill it; an error where its data is asked for
    }
    if (found.size() < length)
      buffer.at("byteLength")
          .fail(fmt::format("the buffer should have {} bytes, its data has {}", length, found.size()));
    out.bytes = found.first(length);
  }
}

void check_views(SourceDocument& d) {
  const auto views = d.root().find("bufferViews");
  if (!views) return;
  d.views.reserve(views->size());
  for (size_t i = 0; i < views->size(); ++i) {
    const JsonView view = (*views)[i];
    const size_t index = view.at("buffer").index(d.buffers.size(), "buffer");
    const std::span<const uint8_t> bytes = d.buffers[index].bytes;
    const auto offset_json = view.find("byteOffset");
    const auto offset = static_cast<uint64_t>(offset_json ? offset_json->integer(0, int64_t{1} << 40) : 0);
    const auto length = static_cast<uint64_t>(view.at("byteLength").integer(1, int64_t{1} << 40));
    if (const auto stride = view.find("byteStride"))
      if (stride->integer(4, 252) % 4 != 0) stride->fail("byteStride is no multiple of 4");
    if (bytes.empty()) {
      d.views.emplace_back();
      continue;
    }
    if (offset > bytes.size() || length > bytes.size() - offset)
      view.fail(fmt::format("bytes {} to {} lie outside of buffer {}, which has {}", offset, offset + length,
                            index, bytes.size()));
    d.views.push_back(bytes.subspan(offset, length));
  }
}

// Names of the files beside the asset, for export to carry over. A reference that must not be followed is
// left to whoever needs it.
void note_references(SourceDocument& d) {
  for (const SourceBuffer& buffer : d.buffers)
    if (!buffer.reference.empty()) d.references.push_back(buffer.reference);
  const auto images = d.root().find("images");
  for (size_t i = 0; images && i < images->size(); ++i) {
    const auto uri = (*images)[i].find("uri");
    if (!uri || is_data_uri(uri->string())) continue;
    try {
      const std::string reference = percent_decoded(uri->string(), uri->where());
      resolve_inside(d.folder(), reference, uri->where());
      d.references.push_back(reference);
    } catch (const Error&) {
      continue;
    }
  }
}

}  // namespace

MemoryBudget memory_budget(uint64_t source_bytes) {
  // Meshopt makes at most 64 bytes of one: two bits for 16 bytes that are as the vertex before has them.
  return {4000000 + source_bytes / 2, (uint64_t{1} << 30) + 200 * source_bytes,
          (uint64_t{1} << 26) + 64 * source_bytes};
}

uint64_t source_bytes(const SourceDocument& document) {
  uint64_t sum = document.file.size();
  for (const SourceBuffer& buffer : document.buffers) sum += buffer.owned.size();
  return sum;
}

bool is_glb(std::span<const uint8_t> file) {
  return file.size() >= 4 && std::memcmp(file.data(), "glTF", 4) == 0;
}

OpenedGltf open_gltf(const std::filesystem::path& path, std::vector<uint8_t> file) {
  auto d = std::make_shared<SourceDocument>();
  std::vector<std::string> warnings;
  d->path = path;
  d->name = path.string();
  d->file = std::move(file);
  if (is_glb(d->file)) {
    d->kind = SourceDocument::Kind::kGlb;
    split_glb(*d, warnings);
  } else {
    d->kind = SourceDocument::Kind::kGltf;
    d->json_end = d->file.size();
  }
  d->json = parse_json(d->json_text(), d->name);
  if (!d->json.is_object())
    throw Error(ErrorCode::kFormat, d->name,
                fmt::format("the JSON is {}, expected an object", d->json.type_name()));
  check_asset_and_extensions(*d);
  note_extensions(*d, warnings);
  load_buffers(*d);
  check_views(*d);
  decompress_meshopt_views(*d);
  note_references(*d);
  return {std::move(d), std::move(warnings)};
}

EncodedImage encoded_image(const SourceDocument& d, size_t index) {
  const JsonView image = d.root().at("images")[index];
  if (const auto uri = image.find("uri")) {
    const std::string& text = uri->string();
    if (is_data_uri(text)) return {decode_data_uri(text, uri->where()), ""};
    const std::string reference = percent_decoded(text, uri->where());
    const auto path = resolve_inside(d.folder(), reference, uri->where());
    try {
      return {read_file(path), reference};
    } catch (const Error& e) {
      uri->fail(fmt::format("the image file '{}' {}", printable(reference),
                            e.code() == ErrorCode::kNotFound ? "does not exist" : e.message()),
                e.code());
    }
  }
  const JsonView view = image.at("bufferView");
  const auto bytes = d.views[view.index(d.views.size(), "bufferView")];
  if (bytes.empty()) view.fail("the buffer has no data that patina can read");
  return {{bytes.begin(), bytes.end()}, ""};
}

}  // namespace patina::asset

// The reader of weight files: what it reads, and that every malformed file is refused with a message that
// says why.
#include "patina/nn/safetensors.h"

#include <cstring>
#include <fstream>
#include <sstream>

#include "../support.h"
#include "patina/base/error.h"

namespace patina::nn {
namespace {

using test::TemporaryFolder;
namespace fs = std::filesystem;

fs::path write_raw(const fs::path& path, const std::string& header, size_t data_bytes) {
  std::string bytes(8, '\0');
  const uint64_t length = header.size();
  std::memcpy(bytes.data(), &length, 8);
  bytes += header + std::string(data_bytes, '\1');
  write_file(path, bytes);
  return path;
}

std::string refusal(const fs::path& path) {
  try {
    SafeTensors file(path);
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

struct Malformed {
  std::string header;
  size_t data_bytes;
  std::string message;  // part of what the error says
};

TEST(SafeTensors, reads_back_what_was_written) {
  TemporaryFolder folder;
  const std::vector<float> weight{1, 2, 3, 4, 5, 6};
  const std::vector<int64_t> ids{7, 8};
  const auto bytes = [](const auto& v) {
    return std::span(reinterpret_cast<const uint8_t*>(v.data()), v.size() * sizeof(v[0]));
  };
  const std::vector<TensorEntry> tensors{{"a.weight", ElementType::kF32, {2, 3}, bytes(weight)},
                                         {"empty", ElementType::kBF16, {0, 3}, {}},
                                         {"ids", ElementType::kI64, {1, 2}, bytes(ids)}};
  write_safetensors(folder.path() / "x.safetensors", tensors, {{"made by", "a test"}});

  const SafeTensors file(folder.path() / "x.safetensors");
  ASSERT_EQ(file.tensors().size(), 3u);
  EXPECT_EQ(file.metadata().at("made by"), "a test");
  for (const TensorEntry& expected : tensors) {
    const TensorEntry* found = file.find(expected.name);
    ASSERT_NE(found, nullptr) << expected.name;
    EXPECT_EQ(found->type, expected.type);
    EXPECT_EQ(found->shape, expected.shape);
    EXPECT_EQ(std::vector(found->bytes.begin(), found->bytes.end()),
              std::vector(expected.bytes.begin(), expected.bytes.end()));
  }
  EXPECT_EQ(reinterpret_cast<uintptr_t>(file.find("a.weight")->bytes.data()) % 64, 0u);
  EXPECT_EQ(file.find("b.weight"), nullptr);
}

TEST(SafeTensors, refuses_malformed_headers_and_says_why) {
  TemporaryFolder folder;
  const std::string w = R"("w":{"dtype":"F32","shape":[2],"data_offsets":[0,8]})";
  const std::vector<Malformed> cases{
      {"{" + w + "," + w + "}", 8, "tensor 'w' is given twice"},
      {"{" + w + R"(,"__metadata__":{},"__metadata__":{}})", 8, "__metadata__ is given twice"},
      {R"({"w":{"dtype":"F32","shape":[2],"shape":[2],"data_offsets":[0,8]}})", 8, "gives 'shape' twice"},
      {R"({"w":{"dtype":"F32","shape":[3],"data_offsets":[0,8]}})", 8,
       "needs 12 bytes, but its data_offsets hold 8"},
      {R"({"w":{"dtype":"F32","shape":[-2],"data_offsets":[0,8]}})", 8, "holds a negative number"},
      {R"({"w":{"dtype":"F32","shape":[18446744073709551617],"data_offsets":[0,8]}})", 8,
       "expected unsigned integers"},
      {R"({"w":{"dtype":"F32","shape":[4294967296,4294967296],"data_offsets":[0,8]}})", 8, "overflows"},
      {R"({"w":{"dtype":"F32","shape":[2],"data_offsets":[0,8]}})", 7, "holds 7 bytes of data"},
      {R"({"w":{"dtype":"F32","shape":[2],"data_offsets":[0,8]}})", 9, "1 bytes follow the last tensor"},
      {R"({"w":{"dtype":"F32","shape":[2],"data_offsets":[4,12]}})", 12,
       "a hole of 4 bytes before tensor 'w'"},
      {"{" + w + R"(,"v":{"dtype":"F32","shape":[2],"data_offsets":[4,12]}})", 12, "overlaps 'w'"},
      {R"({"w":{"dtype":"F7","shape":[2],"data_offsets":[0,8]}})", 8, "the dtype 'F7'"},
      {R"({"w":{"shape":[2],"data_offsets":[0,8]}})", 8, "no dtype"},
      {R"({"w":7})", 8, "tensor 'w' is a number, expected an object"},
      {"[1]", 0, "does not begin with '{'"},
      {"{" + w + "} trailing", 8, "not valid JSON"},
      {"{\"w\xC0\x80\":{}}", 0, "not valid JSON"},
      {R"({"w":)" + std::string(200'000, '['), 0, "tensor 'w' is an array"},
  };
  for (const Malformed& c : cases) {
    const std::string message = refusal(write_raw(folder.path() / "x.safetensors", c.header, c.data_bytes));
    EXPECT_NE(message.find(c.message), std::string::npos)
        << c.header.substr(0, 120) << "\n  got: " << message;
    EXPECT_NE(message.find("x.safetensors"), std::string::npos) << message;
  }
}

TEST(SafeTensors, names_the_format_of_files_that_are_something_else) {
  TemporaryFolder folder;
  const auto message = [&](const std::string& name, const std::string& bytes) {
    write_file(folder.path() / name, bytes);
    return refusal(folder.path() / name);
  };
  EXPECT_NE(message("a.safetensors", std::string("GGUF\3\0\0\0\0\0\0\0", 12)).find("GGUF"),
            std::string::npos);
  EXPECT_NE(message("a.safetensors", std::string("PK\3\4aaaaaaaa")).find("zip"), std::string::npos);
  EXPECT_NE(message("a.safetensors", std::string("\x80\x04}.")).find("runs code"), std::string::npos);
  for (const char* name : {"a.ckpt", "a.pth", "a.pt", "a.bin"}) {
    EXPECT_NE(message(name, "whatever it holds").find("runs code"), std::string::npos) << name;
  }
}

TEST(SafeTensors, treats_every_shared_file_as_its_manifest_says) {
  PATINA_REQUIRE_SHARED("bad-inputs/MANIFEST.tsv");
  const fs::path root = test::shared_dir() / "bad-inputs";
  std::ifstream manifest(root / "MANIFEST.tsv");
  int checked = 0;
  for (std::string line; std::getline(manifest, line);) {
    std::istringstream fields(line);
    std::string path, expect, what;
    std::getline(fields, path, '\t'), std::getline(fields, expect, '\t'), std::getline(fields, what, '\t');
    if (path.rfind("safetensors/", 0) != 0) continue;
    const std::string message = refusal(root / path);
    if (expect == "accept") {
      EXPECT_EQ(message, "accepted") << path << ": " << what;
    }
    if (expect == "reject") {
      EXPECT_NE(message, "accepted") << path << ": " << what;
      EXPECT_NE(message.find(fs::path(path).filename().string()), std::string::npos) << message;
    }
    for (const char c : message) EXPECT_GE(static_cast<unsigned char>(c), 0x20) << path;
    ++checked;
  }
  EXPECT_GT(checked, 50);
}

}  // namespace
}  // namespace patina::nn

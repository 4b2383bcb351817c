// Tensors from weight files, and what a network that does not fit its file is told.
#include "patina/nn/weights.h"

#include <bit>
#include <cstring>

#include <ATen/ATen.h>

#include "../support.h"
#include "patina/base/error.h"
#include "patina/nn/file_weights.h"

namespace patina::nn {
namespace {

std::span<const uint8_t> bytes_of_vector(const auto& values) {
  return {reinterpret_cast<const uint8_t*>(values.data()), values.size() * sizeof(values[0])};
}

class Weights : public testing::Test {
 protected:
  Weights() {
    const std::vector<TensorEntry> tensors{{"a.weight", ElementType::kF32, {2, 3}, bytes_of_vector(values_)},
                                           {"a.bias", ElementType::kBF16, {3}, bytes_of_vector(bf16_)},
                                           {"ids", ElementType::kI64, {2}, bytes_of_vector(ids_)}};
    write_safetensors(path(), tensors);
  }
  std::filesystem::path path() const { return folder_.path() / "model.safetensors"; }

  std::string finish_message(const WeightReader& reader) {
    try {
      reader.finish();
    } catch (const Error& error) {
      return error.what();
    }
    return "fits";
  }

  test::TemporaryFolder folder_;
  std::vector<float> values_{1, -2, 3, 0.5f, 1e-3f, 7};
  std::vector<uint16_t> bf16_{0x3F80, 0x4000, 0xC040};  // 1, 2, -3
  std::vector<int64_t> ids_{4, 5};
};

TEST_F(Weights, f32_lies_in_the_map_and_outlives_the_file_object) {
  at::Tensor weight;
  {
    const SafeTensors file(path());
    weight = read_tensor(file, *file.find("a.weight"), at::kFloat);
    EXPECT_EQ(weight.data_ptr(), file.find("a.weight")->bytes.data());
  }
  EXPECT_EQ(std::memcmp(weight.data_ptr(), values_.data(), values_.size() * sizeof(float)), 0);
}

TEST_F(Weights, converts_to_the_type_asked_for) {
  const SafeTensors file(path());
  const at::Tensor bias = read_tensor(file, *file.find("a.bias"), at::kFloat);
  EXPECT_TRUE(at::equal(bias, at::tensor({1.0f, 2.0f, -3.0f})));
  EXPECT_EQ(read_tensor(file, *file.find("a.weight"), at::kBFloat16).scalar_type(), at::kBFloat16);
  EXPECT_THROW(read_tensor(file, *file.find("ids"), at::kFloat), Error);
}

TEST_F(Weights, reads_tensors_of_any_alignment) {
  // A header of odd length puts the data at an odd address.
  std::string header = R"({"w":{"dtype":"F32","shape":[2],"data_offsets":[0,8]}})";
  if (header.size() % 2 == 0) header += ' ';
  std::string text(8, '\0');
  const uint64_t length = header.size();
  std::memcpy(text.data(), &length, 8);
  text += header + std::string(reinterpret_cast<const char*>(values_.data()), 8);
  write_file(path(), text);
  const SafeTensors file(path());
  EXPECT_TRUE(at::equal(read_tensor(file, *file.find("w"), at::kFloat), at::tensor({1.0f, -2.0f})));
}

TEST_F(Weights, names_all_that_is_missing_and_misshapen_at_once) {
  const SafeTensors file(path());
  FileWeights source(file);
  WeightReader reader(source, at::kFloat);
  reader.take("a.weight", {3, 2});
  reader.take("a.bias", {3});
  EXPECT_EQ(reader.take("b.weight", {4, 5}).sizes(), at::IntArrayRef({4, 5}));
  const std::string message = finish_message(reader);
  EXPECT_NE(message.find("model.safetensors"), std::string::npos) << message;
  EXPECT_NE(message.find("1 tensors are missing: b.weight [4, 5]"), std::string::npos) << message;
  EXPECT_NE(message.find("a.weight (expected [3, 2], found [2, 3])"), std::string::npos) << message;
}

TEST_F(Weights, refuses_tensors_that_nobody_asked_for_unless_they_are_known) {
  const SafeTensors file(path());
  FileWeights source(file);
  WeightReader reader(source, at::kFloat);
  reader.take("a.weight", {2, 3});
  reader.take("a.bias", {3});
  EXPECT_NE(finish_message(reader).find("1 tensors do not belong to a network of this configuration: ids"),
            std::string::npos);
  reader.ignore("ids");
  EXPECT_EQ(finish_message(reader), "fits");
  EXPECT_EQ(reader.count().parameters, 9);
  EXPECT_EQ(reader.count().bytes, 36);
}

}  // namespace
}  // namespace patina::nn

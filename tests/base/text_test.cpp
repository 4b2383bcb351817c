#include "patina/base/text.h"

#include <gtest/gtest.h>

namespace patina {
namespace {

TEST(Text, lower_case_changes_latin_capitals_alone) {
  EXPECT_EQ(lowered("Kettle.GLB"), "kettle.glb");
  EXPECT_EQ(lowered("@AZ[`az{ 09"), "@az[`az{ 09");
  EXPECT_EQ(lowered("\xC3\x84.OBJ"), "\xC3\x84.obj");  // Ä in UTF-8 keeps its bytes
  EXPECT_EQ(lowered(""), "");
}

}  // namespace
}  // namespace patina

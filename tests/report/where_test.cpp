#include "patina/report/where.h"

#include <vector>

#include <gtest/gtest.h>

#include "markup.h"
#include "pictures.h"

namespace patina::report {
namespace {

TEST(Where, shows_a_mask_for_each_material_and_view) {
  const std::vector<MaskPicture> masks{{"enamel", Image(8, 8, 1, 0.5f)}, {"<steel>", Image(8, 4, 1, 1.0f)}};
  const std::vector<Image> views(3, Image(16, 16, 1, -1.0f));
  const std::string html = where(masks, views);
  test::expect_balanced("<body>" + html + "</body>");
  for (const char* part : {"Where it may change", "Mask of enamel", "&lt;steel&gt;", "View 3"})
    EXPECT_NE(html.find(part), std::string::npos) << part;
  EXPECT_EQ(html.find("View 4"), std::string::npos);
}

TEST(Where, protected_materials_alone_have_no_mask_but_are_seen_in_the_views) {
  const std::vector<Image> views{Image(16, 16, 1, 1.0f)};
  const std::string html = where({}, views);
  EXPECT_EQ(html.find("On the textures"), std::string::npos);
  EXPECT_NE(html.find("In the views"), std::string::npos);
}

TEST(Where, without_masks_is_nothing) {
  EXPECT_EQ(where({}, {}), "");
}

}  // namespace
}  // namespace patina::report

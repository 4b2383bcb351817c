#include "edits_part.h"

#include <cmath>
#include <cstdio>
#include <map>

#include "asked.h"
#include "judge.h"
#include "patina/image/image_io.h"
#include "patina/pipeline/measures.h"
#include "patina/report/report.h"
#include "structure.h"

namespace patina::bench {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using pipeline::json_number;

// Inside counts from here: nearer to the silhouette every picture has its edge.
constexpr int kSilhouettePixels = 3;
// Where bleeding shows: not in the pixels that the silhouette itself crosses, nor far out on the ground.
constexpr int kBleedNearest = 2, kBleedFarthest = 16;

struct Mean {
  double sum = 0, count = 0;
  void add(double value) {
    if (std::isfinite(value)) sum += value, ++count;
  }
  double value() const { return sum / count; }
};

std::vector<uint8_t> covered(const Image& coverage, float least) {
  std::vector<uint8_t> out;
  for (const float c : coverage.pixels) out.push_back(c >= least);
  return out;
}

std::vector<uint8_t> inverted(std::vector<uint8_t> marks) {
  for (uint8_t& m : marks) m = !m;
  return marks;
}

// Of one asset's views: edges as rendered, and which pixels count.
struct ViewMarks {
  std::vector<uint8_t> edges, inside, ground_near, all;
};
std::vector<ViewMarks> marks_of(const AssetEditor& editor) {
  std::vector<ViewMarks> out;
  for (size_t v = 0; v < editor.coverage().size(); ++v) {
    const Image& coverage = editor.coverage()[v];
    const int width = coverage.width;
    // Nothing of the asset at all, so that materials which may not change are no ground.
    std::vector<uint8_t> hit(coverage.num_pixels());
    const views::GBuffer& gbuffer = editor.views().set.views[v].gbuffer;
    for (size_t i = 0; i < hit.size(); ++i) hit[i] = gbuffer.primitive[i] >= 0 || coverage.pixels[i] > 0;
    out.push_back({.edges = edge_map(editor.views().tile[v]),
                   .inside = inverted(ring(inverted(covered(coverage, 1.0f)), width, 0, kSilhouettePixels)),
                   .ground_near = ring(hit, width, kBleedNearest, kBleedFarthest),
                   .all = std::vector<uint8_t>(coverage.num_pixels(), 1)});
  }
  return out;
}

// What edits keep, over all runs.
struct Structure {
  EdgeMatch inside, with_silhouette, by_chance;
  Mean bleed, change;

  void add(const AssetEditor& editor, const std::vector<ViewMarks>& marks, std::span<const Image> edited) {
    for (size_t v = 0; v < edited.size(); ++v) {
      const std::vector<uint8_t> edges = edge_map(edited[v]);
      const int width = edited[v].width;
      inside.add(match_edges(edges, marks[v].edges, marks[v].inside, width));
      with_silhouette.add(match_edges(edges, marks[v].edges, marks[v].all, width));
      // The same asset from elsewhere has as many edges of the same kind, in other places.
      const ViewMarks& other = marks[(v + 1) % marks.size()];
      by_chance.add(match_edges(edges, other.edges, marks[v].inside, width));
      bleed.add(mean_change(edited[v], editor.views().tile[v], marks[v].ground_near));
      change.add(mean_change(edited[v], editor.views().tile[v], marks[v].inside));
    }
  }

  json to_json() const {
    return {{"edge_f_score", json_number(inside.f_score())},
            {"edge_precision", json_number(inside.precision())},
            {"edge_recall", json_number(inside.recall())},
            {"edge_f_score_with_silhouette", json_number(with_silhouette.f_score())},
            {"edge_f_score_by_chance", json_number(by_chance.f_score())},
            {"silhouette_bleed", json_number(bleed.value())},
            {"change_inside", json_number(change.value())}};
  }
};

}  // namespace

json measure_edits(std::span<const HeldOutAsset> assets, const EditSettings& settings,
                   const Discriminant& classifier, const fs::path& folder,
                   std::optional<diffusion::Model>& model) {
  const auto& classes = asked_classes();
  Structure structure;
  Mean clean_psnr, clean_psnr_whole;
  json runs = json::array(), clean = json::object();
  std::vector<int> hits1(classes.size(), 0), hits3(classes.size(), 0);
  std::map<std::string, std::map<std::string, int>> seen_as;
  std::vector<Image> pictures;

  for (size_t a = 0; a < assets.size(); ++a) {
    const AssetEditor editor(assets[a], settings, folder, model);
    const std::vector<ViewMarks> marks = marks_of(editor);
    const std::vector<Image>& before = editor.views().tile;
    pictures.push_back(before[0]);

    const std::vector<Image> as_it_is = editor.edited("clean", assets[a].clean_prompt);
    pictures.push_back(as_it_is[0]);
    Mean psnr;
    for (size_t v = 0; v < before.size(); ++v) {
      psnr.add(report::psnr(as_it_is[v], before[v], editor.coverage()[v]));
      clean_psnr_whole.add(report::psnr(as_it_is[v], before[v]));
    }
    clean_psnr.add(psnr.value());
    clean[assets[a].name] = {{"prompt", assets[a].clean_prompt}, {"psnr", json_number(psnr.value())}};

    for (size_t c = 0; c < classes.size(); ++c) {
      const std::string prompt = prompt_of(classes[c], assets[a].words, a);
      std::printf("\r%-8s %2zu of %zu  %-60.60s", assets[a].name.c_str(), c + 1, classes.size(),
                  prompt.c_str());
      std::fflush(stdout);
      const std::vector<Image> edited = editor.edited(classes[c].name, prompt);
      std::vector<JudgedView> judged;
      for (size_t v = 0; v < edited.size(); ++v)
        judged.push_back({&before[v], &edited[v], &editor.coverage()[v]});
      const Ranking ranking = judge_edit(classifier, judged);
      const int place = ranking.place_of(static_cast<int>(c));
      hits1[c] += place < 1, hits3[c] += place < 3;
      json first_three = json::array();
      for (size_t i = 0; i < 3; ++i)
        first_three.push_back(classes[static_cast<size_t>(ranking.classes[i])].name);
      if (place >= 3) ++seen_as[classes[c].name][first_three[0].get<std::string>()];
      runs.push_back({{"asset", assets[a].name},
                      {"class", classes[c].name},
                      {"prompt", prompt},
                      {"place", place + 1},
                      {"first_three", first_three}});
      structure.add(editor, marks, edited);
      pictures.push_back(edited[0]);
    }
  }
  std::printf("\n");
  write_image(folder / "obedience.png", report::contact_sheet(pictures, 11, 160));

  json table = json::object();
  int all1 = 0, all3 = 0;
  for (size_t c = 0; c < classes.size(); ++c) {
    table[classes[c].name] = {{"runs", assets.size()},
                              {"top1", hits1[c]},
                              {"top3", hits3[c]},
                              {"seen_as", seen_as[classes[c].name]}};
    all1 += hits1[c], all3 += hits3[c];
  }
  const auto count = static_cast<double>(runs.size());
  return {{"obedience",
           {{"top3", all3 / count},
            {"top1", all1 / count},
            {"runs", runs.size()},
            {"num_classes", classes.size()},
            {"classes", table},
            {"each", runs}}},
          {"clean",
           {{"psnr", json_number(clean_psnr.value())},
            {"psnr_with_ground", json_number(clean_psnr_whole.value())},
            {"assets", clean}}},
          {"structure", structure.to_json()}};
}

}  // namespace patina::bench

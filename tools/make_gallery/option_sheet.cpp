#include "option_sheet.h"

#include <optional>
#include <span>

#include "patina/pipeline/bundled_model.h"
#include "patina/pipeline/options.h"
#include "patina/pipeline/run_folder.h"
#include "patina/pipeline/stages.h"
#include "patina/report/report.h"

namespace patina::make_gallery {

namespace fs = std::filesystem;

Image option_sheet(const OptionSheet& sheet, const std::vector<pipeline::Config>& edits,
                   const fs::path& folder, int view, int side, const Progress& progress) {
  std::vector<Image> pictures;
  std::optional<diffusion::Model> model;
  for (pipeline::Config config : edits) {
    pipeline::settle(config);
    const pipeline::Workbench bench = pipeline::open_workbench(config, progress);
    pipeline::RunFolder renders(folder / config.asset.stem());
    const pipeline::RenderedViews views = pipeline::render_stage(bench, config, renders, progress);
    pictures.push_back(views.tile.at(static_cast<size_t>(view)));
    for (const std::string& value : sheet.values) {
      pipeline::Config changed = config;
      pipeline::find_option(sheet.option)->set(changed, std::span(&value, 1));
      pipeline::RunFolder run(folder / config.asset.stem() / (sheet.option + "-" + value));
      run.adopt_stage(renders, "render");
      pictures.push_back(
          pipeline::detail_stage(bench, views, changed, run, progress, &model)[static_cast<size_t>(view)]);
    }
  }
  return report::contact_sheet(pictures, static_cast<int>(sheet.values.size()) + 1, side);
}

}  // namespace patina::make_gallery

#include "option_sheet.h"

#include <optional>
#include <span>

#include "patina/pipeline/options.h"
#include "patina/pipeline/run_folder.h"
#include "patina/pipeline/stages.h"
#include "patina/report/report.h"

namespace patina::make_gallery {

namespace fs = std::filesystem;

Image option_sheet(const OptionSheet& sheet, const std::vector<pipeline::Config>& edits,
                   const fs::path& folder, int view, int side, const Progress& progress) {
  std::vector<Image> pictures;
  std::optional<pipeline::ResolvedModel> model;
  for (pipeline::Config config : edits) {
    pipeline::settle(config);
    const pipeline::Workbench bench = pipeline::open_workbench(config.inputs, progress);
    if (!model) model.emplace(config.edit);
    pipeline::RunFolder renders(folder / config.inputs.asset.stem());
    const pipeline::RenderedViews views = pipeline::render_stage(bench, config.render, renders, {progress});
    pictures.push_back(views.tile.at(static_cast<size_t>(view)));
    for (const std::string& value : sheet.values) {
      pipeline::Config changed = config;
      const pipeline::Option& option = *pipeline::find_option(sheet.option);
      option.set(changed, pipeline::value_of_texts(option, std::span(&value, 1)));
      pipeline::RunFolder run(folder / config.inputs.asset.stem() / (sheet.option + "-" + value));
      run.adopt_stage(renders, "render");
      pictures.push_back(pipeline::edit_stage(bench, pipeline::unmasked(bench), views, changed.edit, *model,
                                              run, {progress})[static_cast<size_t>(view)]);
    }
  }
  return report::contact_sheet(pictures, static_cast<int>(sheet.values.size()) + 1, side);
}

}  // namespace patina::make_gallery

#include "patina/pipeline/show_attention.h"

#include <cmath>

#include <fmt/format.h>

#include "patina/base/error.h"
#include "patina/image/image_io.h"
#include "patina/pipeline/enhance.h"
#include "patina/report/html.h"
#include "patina/report/report.h"

namespace patina::pipeline {

namespace fs = std::filesystem;
using diffusion::AttentionLayer;

namespace {

// The latent pixel of the layer's grid that covers a pixel of a view.
int32_t latent_pixel_at(const AttentionLayer& layer, int grid, int view, const vec2& pixel,
                        const render::Camera& camera) {
  const auto columns = static_cast<int>(layer.width) / grid, rows = static_cast<int>(layer.height) / grid;
  const int x =
      std::min(static_cast<int>(pixel.x * static_cast<float>(columns) / static_cast<float>(camera.width)),
               columns - 1);
  const int y = std::min(
      static_cast<int>(pixel.y * static_cast<float>(rows) / static_cast<float>(camera.height)), rows - 1);
  return (view / grid * rows + y) * static_cast<int>(layer.width) + view % grid * columns + x;
}

std::vector<AttentionLayer> layers_of(const diffusion::Model& model, const Workbench& bench) {
  const int grid = views::grid_of(bench.cameras.size());
  return diffusion::self_attention_layers(model, grid * bench.cameras[0].width,
                                          grid * bench.cameras[0].height);
}

}  // namespace

std::vector<AttentionLayer> list_attention_layers(Config config, const Progress& progress) {
  settle(config);
  ResolvedModel model(config.edit);
  return layers_of(model.loaded(), open_workbench(config.inputs, progress));
}

ShownAttention show_attention(Config config, const AttentionOptions& options, RunFolder& run,
                              const RunProgress& progress) {
  settle(config);
  if (config.edit.options.bias_weight == 0)
    throw Error(ErrorCode::kUsage, "bias",
                "expected other than 0: attention is shown without and with the bias");
  check_inputs(config);
  ResolvedModel resolved(config.edit);
  const Workbench bench = open_workbench(config.inputs, progress);
  const diffusion::Model& model = resolved.loaded();
  const render::Camera& camera = bench.cameras[0];
  const int grid = views::grid_of(bench.cameras.size());
  const AttentionLayer layer = diffusion::find_layer(layers_of(model, bench), options.layer);

  const RenderedViews views = render_stage(bench, config.render, run, progress);
  const PickedPoint point = pick_point(*bench.scene, views.set, options.point);
  const PreparedEdit prepared = prepare_edit(bench, unmasked(bench), views, config.edit, model, progress);
  ShownAttention shown;
  shown.negative_prompt = diffusion::guidance_of(model, config.edit.options).negative_prompt;
  shown.captured = diffusion::capture_attention(model, prepared.inputs, prepared.options, layer,
                                                options.evaluation, progress);
  if (shown.captured.bias_level < 0)
    throw Error(ErrorCode::kUsage, "layer",
                fmt::format("the bias does not act at the resolution of {}; choose a finer layer",
                            diffusion::short_name(layer)));
  const attention::KeyBuckets& buckets =
      prepared.inputs.bias_levels[static_cast<size_t>(shown.captured.bias_level)];

  shown.view = point.view;
  shown.pixel = point.sights[static_cast<size_t>(point.view)]->pixel;
  report::AttentionFigure& figure = shown.figure;
  figure.views = views::tile_grid(views.tile);
  figure.grid = grid;
  figure.cells = {static_cast<int>(layer.width), static_cast<int>(layer.height)};
  figure.query = latent_pixel_at(layer, grid, shown.view, shown.pixel, camera);
  figure.biased_keys = attention::biased_keys(buckets, figure.query);
  figure.without = diffusion::attention_row(shown.captured, figure.query, {}, 0);
  figure.with =
      diffusion::attention_row(shown.captured, figure.query, figure.biased_keys, shown.captured.beta);
  if (figure.biased_keys.empty())
    progress.warn("No latent pixel of another view lands near this point, so the bias changes nothing here.");
  return shown;
}

void check_attention_output(const fs::path& path) {
  if (path.extension() != ".html" && path.extension() != ".png")
    throw Error(ErrorCode::kUsage, "output",
                fmt::format("expected a name that ends in .html (a page) or .png (a picture), found '{}'",
                            printable(path.string())));
}

void write_attention(const ShownAttention& shown, const Config& config, const fs::path& path) {
  check_attention_output(path);
  if (path.extension() == ".png") {
    const std::vector<Image> panels = report::attention_panels(shown.figure);
    write_image(path, report::contact_sheet(panels, static_cast<int>(panels.size()), panels[0].width));
    return;
  }
  const diffusion::CapturedAttention& c = shown.captured;
  report::AttentionPage page;
  page.title = config.inputs.asset.filename().string();
  page.prompt = config.edit.options.prompt, page.negative_prompt = shown.negative_prompt;
  page.figure = shown.figure;
  page.beta = c.beta;
  const bool scaled = config.edit.options.bias_scaling == diffusion::BiasScaling::kPaper;
  page.facts = {fmt::format("layer <b>{}</b>", report::escaped(diffusion::short_name(c.layer))),
                fmt::format("<b>{} × {}</b> latent pixels", c.layer.width, c.layer.height),
                fmt::format("<b>{}</b> heads of <b>{}</b>", c.layer.num_heads, c.layer.head_dim),
                fmt::format("evaluation <b>{}</b> of <b>{}</b>, timestep <b>{:.0f}</b>", c.evaluation,
                            c.num_evaluations, c.timestep),
                fmt::format("view <b>{}</b>, pixel <b>{:.0f}, {:.0f}</b>", shown.view + 1,
                            std::floor(shown.pixel.x), std::floor(shown.pixel.y)),
                fmt::format("w = <b>{}</b>, β = {} = <b>{}</b>", config.edit.options.bias_weight,
                            scaled ? "w/√d" : "w", report::number(c.beta))};
  report::write_attention_page(path, page);
}

}  // namespace patina::pipeline

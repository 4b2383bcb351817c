// Renders every camera with one exposure, and fills the G-buffers.
#include "patina/views/view_set.h"

namespace patina::views {

ViewSet render_views(const render::Scene& scene, std::span<const render::Camera> cameras,
                     const ViewOptions& options, const Progress& progress) {
  ViewSet out;
  out.grid = grid_of(cameras.size());
  const auto num_views = static_cast<double>(cameras.size());

  // The environment stays out of camera rays whatever the caller renders with: the ControlNets expect the
  // object over a neutral ground, and `radiance` is promised to be premultiplied by coverage.
  render::PathOptions path = options.path;
  path.show_environment = false;

  for (size_t index = 0; index < cameras.size(); ++index) {
    progress.throw_if_stopped();
    Progress of_view = progress;
    of_view.on_update = [&](std::string_view, double done, double total) {
      progress.update("render", static_cast<double>(index) + done / total, num_views);
    };
    // Views must not share their noise, or the mean over views would not be better than one view.
    path.seed = options.path.seed + index;
    View view;
    view.camera = cameras[index];
    view.gbuffer = make_gbuffer(scene, view.camera);
    render::Render rendered = render::render(scene, view.camera, path, of_view, "render");
    view.radiance = std::move(rendered.radiance);
    view.coverage = std::move(rendered.coverage);
    out.views.push_back(std::move(view));
    progress.update("render", static_cast<double>(index) + 1.0, num_views);
  }
  out.exposure_ev = options.exposure_ev ? *options.exposure_ev : choose_exposure(out.views);
  return out;
}

}  // namespace patina::views

// All of patina for a program that uses it as a library: one include, and the public interface on a page.
// Every other header under patina/ that is not named here serves the library itself and may change at any
// time.
//
//   find_package(patina REQUIRED)
//   target_link_libraries(my_program PRIVATE patina::patina)
//
// examples/render_and_fit is a whole program. The library prints nothing and starts or ends no process. It
// reports through Progress, fails by throwing Error, and depends on no global state but the number of
// threads, which the program sets. No header below includes LibTorch.
//
// A whole run, as `patina enhance` does it:
//   pipeline::enhance(config, run, progress)   every stage that has to run; the results in a run folder
//
// Step by step:
//   asset::read_asset(path) → Asset            glTF, GLB or OBJ, with all that export needs to keep
//   asset::resolve_materials(asset)            → MaterialMaps: linear texels, factors multiplied in
//   render::Scene(asset, maps, environment)    ray casting and materials
//   render::render(scene, camera, options)     → Render: path-traced radiance and coverage
//   views::orbit_cameras(asset, options)       cameras around an asset
//   views::render_views(scene, cameras, ...)   → ViewSet: renders, G-buffers and one exposure for all
//   views::tile_control, views::normal_control the pictures that a diffusion model is conditioned on
//   correspond::make_noise, bias_levels        what the views share: starting noise, corresponding pixels
//   diffusion::find_model_parts(paths)         the files of a diffusion model, opened and told apart
//   diffusion::Model(parts, options)           its weights, loaded
//   diffusion::edit_views(model, inputs, ...)  pictures and a prompt in, edited pictures out
//   inverse::fit_materials(scene, views, ...)  → FitResult: maps whose renders look like the edited views
//   asset::export_asset(asset, maps, ...)      the same file with new textures
//   report::write_report(path, data)           what was done, on one HTML page
#pragma once

// Foundations: errors, progress, threads, images.
#include "patina/base/error.h"
#include "patina/base/progress.h"
#include "patina/image/color.h"
#include "patina/image/image.h"
#include "patina/image/image_io.h"
#include "patina/nn/threads.h"

// Assets and pictures of them.
#include "patina/asset/asset.h"
#include "patina/asset/material_maps.h"
#include "patina/render/camera.h"
#include "patina/render/environment.h"
#include "patina/render/path_tracer.h"
#include "patina/render/scene.h"
#include "patina/views/view_set.h"

// From views to edited views to textures.
#include "patina/correspond/consistency.h"
#include "patina/correspond/correspondences.h"
#include "patina/correspond/noise.h"
#include "patina/diffusion/edit.h"
#include "patina/diffusion/model.h"
#include "patina/diffusion/model_parts.h"
#include "patina/diffusion/options.h"
#include "patina/inverse/fit.h"

// All of it in order, and what came of it.
#include "patina/pipeline/config.h"
#include "patina/pipeline/enhance.h"
#include "patina/report/report.h"

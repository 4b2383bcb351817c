// The subcommands of patina. Each adds itself to the program; what it does when chosen is one call into the
// pipeline.
#pragma once

#include <CLI/CLI.hpp>

namespace patina::app {

void add_enhance(CLI::App& program);
void add_batch(CLI::App& program);
void add_render(CLI::App& program);
void add_detail(CLI::App& program);
void add_fit(CLI::App& program);
void add_report(CLI::App& program);
void add_ablate(CLI::App& program);
void add_show_attention(CLI::App& program);
void add_info(CLI::App& program);
void add_models(CLI::App& program);
void add_doctor(CLI::App& program);

}  // namespace patina::app

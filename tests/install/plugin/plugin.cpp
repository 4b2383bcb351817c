#include <patina/patina.h>

extern "C" int num_materials_of(const char* asset) {
  return static_cast<int>(patina::asset::read_asset(asset).materials.size());
}
// Never called: what matters is that every folder's code can be part of a shared library.
extern "C" void enhance(const patina::pipeline::Config& config, patina::pipeline::RunFolder& run) {
  patina::pipeline::enhance(config, run, {});
}

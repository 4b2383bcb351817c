// The targets under libFuzzer:   fuzz_patina TARGET [CORPUS_FOLDER] [libFuzzer's options]
// Seeds of the source tree and regression files are added, and the target's dictionary.
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "targets.h"

namespace {

const patina::fuzz::Target* chosen = nullptr;

}  // namespace

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  static std::vector<std::string> texts;
  static std::vector<char*> pointers;
  try {
    chosen = &patina::fuzz::find_target(*argc > 1 ? (*argv)[1] : "");
  } catch (const std::exception& e) {
    std::fprintf(stderr, "fuzz_patina: %s\n", e.what());
    std::exit(2);
  }
  texts.emplace_back((*argv)[0]);
  for (int i = 2; i < *argc; ++i) texts.emplace_back((*argv)[i]);
  for (const auto& folder : patina::fuzz::seed_folders(*chosen)) texts.push_back(folder.string());
  for (const auto& extra : {patina::fuzz::regressions(*chosen)})
    if (std::filesystem::exists(extra)) texts.push_back(extra.string());
  const auto dictionary = patina::fuzz::source_root() / "fuzz" / "dictionaries" / (chosen->name + ".dict");
  if (std::filesystem::exists(dictionary)) texts.push_back("-dict=" + dictionary.string());
  for (std::string& text : texts) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  *argc = static_cast<int>(texts.size());
  *argv = pointers.data();
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  patina::fuzz::run_target(*chosen, std::span(data, size));
  return 0;
}

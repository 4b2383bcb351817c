// What is fuzzed: the readers of files and texts that come from anywhere. A target takes any bytes and must
// return. That the reader refuses them with an Error is an answer; a crash, any other exception and a broken
// promise are findings.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace patina::fuzz {

struct Target {
  std::string name;
  void (*run)(std::span<const uint8_t> bytes);  // throws on a broken promise
  std::vector<std::string> seeds;               // folders, relative to the source tree or to the shared one
  std::string extension;                        // of the seeds that are taken; empty: all
};

/// All targets, in the order of docs/reliability.md.
const std::vector<Target>& targets();
/// Throws Error{kUsage} that lists the targets where there is none of that name.
const Target& find_target(std::string_view name);

/// What a target does with bytes, its refusals taken as answers.
void run_target(const Target& target, std::span<const uint8_t> bytes);

std::filesystem::path source_root();
/// fuzz/regressions/NAME: what once went wrong.
std::filesystem::path regressions(const Target& target);
/// Folders of the seeds that are there: the target's own in the source tree, and those beside it.
std::vector<std::filesystem::path> seed_folders(const Target& target);
/// Files in them and the regressions, in order.
std::vector<std::filesystem::path> seed_files(const Target& target);

/// A folder of this process, removed at its end.
const std::filesystem::path& scratch_folder();
/// Writes a file of the scratch folder; returns its path.
std::filesystem::path scratch_file(const std::string& name, std::span<const uint8_t> bytes);

/// Throws std::logic_error: a promise was broken.
void require(bool holds, const char* promise);

void container(std::span<const uint8_t> bytes);
void scene(std::span<const uint8_t> bytes);
void accessor(std::span<const uint8_t> bytes);
void draco(std::span<const uint8_t> bytes);
void meshopt(std::span<const uint8_t> bytes);
void obj(std::span<const uint8_t> bytes);
void mtl(std::span<const uint8_t> bytes);
void json_patch(std::span<const uint8_t> bytes);
void round_trip(std::span<const uint8_t> bytes);
void picture(std::span<const uint8_t> bytes);
void environment(std::span<const uint8_t> bytes);
void weights(std::span<const uint8_t> bytes);
void tokenizer(std::span<const uint8_t> bytes);
void prompt(std::span<const uint8_t> bytes);
void config(std::span<const uint8_t> bytes);
void run_folder(std::span<const uint8_t> bytes);

}  // namespace patina::fuzz

#include "slurm.h"

#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <system_error>

#include <fmt/format.h>

#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/base/text.h"

namespace patina::app {
namespace {

namespace fs = std::filesystem;

// A word for a shell: nothing in it is special.
std::string quoted(const std::string& word) {
  std::string out = "'";
  for (const char c : word)
    if (c == '\'')
      out += "'\\''";
    else
      out += c;
  return out + "'";
}

// A line of the script that sbatch reads, with quotes as in a shell. Slurm starts no task whose folders have
// a backslash in their names.
std::string directive(const std::string& name, const std::string& value) {
  if (value.empty()) return fmt::format("#SBATCH --{}\n", name);
  for (const char c : value)
    if (static_cast<unsigned char>(c) < ' ' || c == '\\')
      throw Error(ErrorCode::kUsage, "slurm",
                  fmt::format("expected one line without backslashes for --{} of sbatch, found '{}'", name,
                              printable(value)));
  return fmt::format("#SBATCH --{}={}\n", name, quoted(value));
}

struct Answer {
  int exit_code = 0;
  std::string text;  // both streams
};

Answer ask(const std::string& command) {
  FILE* stream = ::popen((command + " 2>&1").c_str(), "r");
  if (!stream) throw Error(ErrorCode::kDevice, "", "the system starts no program");
  Answer answer;
  std::array<char, 4096> part;
  while (const size_t size = std::fread(part.data(), 1, part.size(), stream))
    answer.text.append(part.data(), size);
  const int status = ::pclose(stream);
  answer.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  while (answer.text.ends_with('\n')) answer.text.pop_back();
  return answer;
}

fs::path array_file(const pipeline::Batch& batch) {
  return batch.folder / "slurm" / "array";
}

// Slurm forgets an array a few minutes after its end; then squeue fails or says nothing.
void require_no_array_in_queue(const pipeline::Batch& batch) {
  std::error_code failure;
  if (!fs::exists(array_file(batch), failure)) return;
  const std::string number = read_text_file(array_file(batch));
  const Answer queue = ask("squeue --noheader --jobs=" + quoted(number));
  if (queue.exit_code == 0 && !queue.text.empty())
    throw Error(ErrorCode::kUsage, "slurm",
                fmt::format("array {} of this batch is still queued or runs; wait for it, or end it with "
                            "`scancel {}`",
                            printable(number), printable(number)));
}

}  // namespace

std::string ranges_of(const std::vector<size_t>& numbers) {
  std::string out;
  for (size_t i = 0; i < numbers.size();) {
    size_t last = i;
    while (last + 1 < numbers.size() && numbers[last + 1] == numbers[last] + 1) ++last;
    out += fmt::format("{}{}", out.empty() ? "" : ",", numbers[i]);
    if (last > i) out += fmt::format("-{}", numbers[last]);
    i = last + 1;
  }
  return out;
}

std::string slurm_script(const pipeline::Batch& batch, const SlurmArray& array, const fs::path& program,
                         const fs::path& folder) {
  std::string logs = fs::absolute(batch.folder / "slurm").string();
  for (size_t at = 0; (at = logs.find('%', at)) != std::string::npos; at += 2) logs.insert(at, "%");
  std::string script =
      fmt::format("#!/bin/sh\n# Each task runs its part of {}. What is done stays as it is.\n",
                  printable(array.jobs_file.string())) +
      directive("job-name", "patina " + batch.folder.filename().string()) +
      directive("array", ranges_of(array.task_list)) + directive("output", logs + "/%A_%a.log") +
      directive("chdir", folder.string());
  for (const auto& [name, value] : array.options) script += directive(name, value);
  const std::string threads = array.num_threads > 0 ? std::to_string(array.num_threads)
                                                    : "\"${SLURM_CPUS_PER_TASK:-${SLURM_CPUS_ON_NODE:-0}}\"";
  return script +
         fmt::format("exec {} batch {} --task \"$SLURM_ARRAY_TASK_ID/{}\" --at-once {} --threads {}\n",
                     quoted(program.string()), quoted(array.jobs_file.string()), array.num_tasks,
                     array.at_once, threads);
}

std::string submit(const pipeline::Batch& batch, const SlurmArray& array) {
  require_no_array_in_queue(batch);
  const fs::path file = batch.folder / "slurm" / "array.sh";
  std::error_code ignored;
  write_file(file,
             slurm_script(batch, array, fs::read_symlink("/proc/self/exe", ignored), fs::current_path()));
  const Answer answer = ask("sbatch --parsable " + quoted(file.string()));
  if (answer.exit_code == 127)
    throw Error(ErrorCode::kNotFound, "sbatch",
                fmt::format("there is no Slurm on this machine; the script is {}", printable(file.string())));
  if (answer.exit_code != 0)
    throw Error(ErrorCode::kIo, "sbatch", fmt::format("refuses {}: {}", file.string(), answer.text));
  std::string number = answer.text.substr(0, answer.text.find(';'));  // "123;cluster"
  write_file(array_file(batch), number);
  return number;
}

}  // namespace patina::app

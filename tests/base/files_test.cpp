#include "patina/base/files.h"

#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <fstream>

#include <gtest/gtest.h>

#include "../support.h"
#include "patina/base/error.h"

namespace patina {
namespace {

namespace fs = std::filesystem;

ErrorCode code_of(const std::function<void()>& body) {
  try {
    body();
  } catch (const Error& e) {
    return e.code();
  }
  ADD_FAILURE() << "did not throw";
  return ErrorCode::kUsage;
}

size_t num_entries(const fs::path& folder) {
  return static_cast<size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

class Files : public testing::Test {
 protected:
  const fs::path& folder() const { return folder_.path(); }

 private:
  test::TemporaryFolder folder_;
};

TEST_F(Files, what_was_written_is_read_back) {
  const std::vector<uint8_t> bytes{0, 1, 255, 10, 13, 0};
  write_file(folder() / "a.bin", std::span<const uint8_t>(bytes));
  EXPECT_EQ(read_file(folder() / "a.bin"), bytes);
  write_file(folder() / "a.txt", std::string_view("text\n"));
  EXPECT_EQ(read_text_file(folder() / "a.txt"), "text\n");
  write_file(folder() / "empty", std::string_view());
  EXPECT_TRUE(read_file(folder() / "empty").empty());
}

TEST_F(Files, writing_makes_missing_folders_replaces_and_leaves_nothing_beside) {
  const fs::path path = folder() / "views" / "deep" / "a.txt";
  write_file(path, std::string_view("a long old text"));
  write_file(path, std::string_view("new"));
  EXPECT_EQ(read_text_file(path), "new");
  EXPECT_EQ(num_entries(path.parent_path()), 1u);
}

TEST_F(Files, reading_says_not_found_and_refuses_folders_and_devices) {
  EXPECT_EQ(code_of([&] { read_file(folder() / "missing"); }), ErrorCode::kNotFound);
  EXPECT_EQ(code_of([&] { read_file(folder()); }), ErrorCode::kFormat);
  EXPECT_EQ(code_of([&] { read_file("/dev/zero"); }), ErrorCode::kFormat);
  ASSERT_EQ(::mkfifo((folder() / "pipe").c_str(), 0600), 0);
  EXPECT_EQ(code_of([&] { read_file(folder() / "pipe"); }), ErrorCode::kFormat)
      << "a pipe would block for ever";
  write_file(folder() / "file", std::string_view("x"));
  EXPECT_EQ(code_of([&] { read_file(folder() / "file" / "below"); }), ErrorCode::kNotFound);
}

TEST_F(Files, reading_stops_at_the_limit) {
  write_file(folder() / "a", std::string_view("12345"));
  EXPECT_EQ(read_text_file(folder() / "a", 5), "12345");
  EXPECT_EQ(code_of([&] { read_text_file(folder() / "a", 4); }), ErrorCode::kLimit);
}

TEST_F(Files, errors_name_the_file) {
  try {
    read_file(folder() / "kettle.glb");
    FAIL();
  } catch (const Error& e) {
    EXPECT_NE(std::string(e.what()).find("kettle.glb"), std::string::npos);
  }
}

TEST_F(Files, a_failing_writer_leaves_the_old_file_and_nothing_else) {
  const fs::path path = folder() / "out.glb";
  write_file(path, std::string_view("old"));
  EXPECT_THROW(write_file_with(path,
                               [](const fs::path& temporary) {
                                 std::ofstream(temporary) << "half";
                                 throw std::runtime_error("disk full");
                               }),
               std::runtime_error);
  EXPECT_EQ(read_text_file(path), "old");
  EXPECT_EQ(num_entries(folder()), 1u);
}

TEST_F(Files, the_temporary_path_lies_beside_with_the_same_extension) {
  const fs::path path = folder() / "views" / "a.png";
  write_file_with(path, [&](const fs::path& temporary) {
    EXPECT_EQ(temporary.parent_path(), path.parent_path());
    EXPECT_EQ(temporary.extension(), ".png");
    EXPECT_NE(temporary, path);
    std::ofstream(temporary) << "x";
  });
  EXPECT_TRUE(fs::exists(path));
}

TEST_F(Files, a_writer_that_is_killed_leaves_the_old_file) {
  const fs::path path = folder() / "out.glb";
  write_file(path, std::string_view("old"));
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    write_file_with(path, [](const fs::path& temporary) {
      std::ofstream(temporary) << "half" << std::flush;
      ::raise(SIGKILL);
    });
    ::_exit(0);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFSIGNALED(status));
  EXPECT_EQ(read_text_file(path), "old");
  write_file(path, std::string_view("new"));
  EXPECT_EQ(read_text_file(path), "new");
}

TEST_F(Files, writing_where_it_cannot_be_is_an_io_error) {
  write_file(folder() / "file", std::string_view("x"));
  EXPECT_EQ(code_of([&] { write_file(folder() / "file" / "below.txt", std::string_view("y")); }),
            ErrorCode::kIo);
  fs::create_directory(folder() / "taken");
  write_file(folder() / "taken" / "child", std::string_view("x"));
  EXPECT_EQ(code_of([&] { write_file(folder() / "taken", std::string_view("y")); }), ErrorCode::kIo)
      << "a folder stands there";
  EXPECT_EQ(num_entries(folder()), 2u);
}

TEST_F(Files, a_writer_that_wrote_nothing_is_an_error) {
  EXPECT_EQ(code_of([&] { write_file_with(folder() / "a", [](const fs::path&) {}); }), ErrorCode::kIo);
}

TEST_F(Files, a_map_shows_the_bytes_and_an_empty_file_an_empty_span) {
  write_file(folder() / "a", std::string_view("weights"));
  const MappedFile map(folder() / "a");
  EXPECT_EQ(std::string(map.bytes().begin(), map.bytes().end()), "weights");
  EXPECT_EQ(map.path(), folder() / "a");
  write_file(folder() / "empty", std::string_view());
  EXPECT_TRUE(MappedFile(folder() / "empty").bytes().empty());
  EXPECT_EQ(code_of([&] { MappedFile(folder() / "missing"); }), ErrorCode::kNotFound);
}

TEST_F(Files, a_map_keeps_its_bytes_when_the_file_is_replaced) {
  write_file(folder() / "a", std::string_view("first"));
  const MappedFile map(folder() / "a");
  write_file(folder() / "a", std::string_view("other"));
  EXPECT_EQ(std::string(map.bytes().begin(), map.bytes().end()), "first");
}

// XXH3's 128-bit hash of no bytes, from its specification's sanity checks.
TEST(Hash, of_nothing_is_the_published_value) {
  EXPECT_EQ(hash_text(""), "99aa06d3014798d86001c324468d497f");
}

TEST_F(Files, hashes_agree_and_tell_contents_apart) {
  write_file(folder() / "a", std::string_view("abc"));
  const std::vector<uint8_t> bytes{'a', 'b', 'c'};
  EXPECT_EQ(hash_file(folder() / "a"), hash_text("abc"));
  EXPECT_EQ(hash_bytes(bytes), hash_text("abc"));
  EXPECT_EQ(hash_text("abc").size(), 32u);
  EXPECT_NE(hash_text("abc"), hash_text("abd"));
}

}  // namespace
}  // namespace patina

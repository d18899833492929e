#include "common/files/AtomicFile.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "common/error/UserError.h"
#include "common/files/PreparedOutputs.h"
#include "tests/unit/common/TemporaryFolder.h"

namespace fs = std::filesystem;
using common::replace_file;

namespace {

std::string content(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

TEST(AtomicFile, ReplacesWholeFile) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.txt";
  EXPECT_FALSE(replace_file(path, "a longer first text"));
  EXPECT_FALSE(replace_file(path, "short"));
  EXPECT_EQ(content(path), "short");
  EXPECT_EQ(folder.entries(), 1);
}

unsigned mode_of(const fs::path& path) { return static_cast<unsigned>(fs::status(path).permissions()); }

common::PreparedOutput create_output(const fs::path& path) {
  common::PreparedOutput output = common::prepare_output("--save", path, common::part_of(path));
  EXPECT_FALSE(fs::exists(output.part));
  EXPECT_FALSE(common::create_part(output));
  EXPECT_TRUE(output.is_new);
  return output;
}

TEST(AtomicFile, KeepsPermissionsOfReplacedFile) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.txt";
  EXPECT_FALSE(replace_file(path, "new"));
  const unsigned fresh = mode_of(path);
  for (const unsigned mode : {0600U, 0755U, 0640U, 0666U, fresh}) {
    fs::permissions(path, fs::perms{mode});
    EXPECT_FALSE(replace_file(path, "again"));
    EXPECT_EQ(mode_of(path), mode);
    const common::PreparedOutput output = create_output(path);
    EXPECT_EQ(mode_of(output.part) & ~mode, 0U);  // never wider than the file
    EXPECT_FALSE(common::name_part(output));
    EXPECT_EQ(mode_of(path), mode);
  }
}

TEST(AtomicFile, TellsThatPreparedPartWasRemoved) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.txt";
  const common::PreparedOutput output = create_output(path);
  common::use_prepared_outputs({output}, {[](std::size_t) { return std::error_code(); }, [](std::size_t) {}});
  fs::remove(output.part);
  EXPECT_EQ(replace_file(path, "new"), common::lost_part());
  common::use_prepared_outputs({}, {});
  EXPECT_EQ(folder.entries(), 0);
}

TEST(AtomicFile, PartThatCannotBeCreatedIsNotNew) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.txt";
  common::PreparedOutput output = common::prepare_output("--save", path, common::part_of(path));
  fs::create_directories(output.part / "foreign");
  EXPECT_TRUE(common::create_part(output));
  EXPECT_FALSE(output.is_new);
  fs::remove_all(output.part);
  EXPECT_EQ(folder.entries(), 0);
}

TEST(AtomicFile, RefusesFileWithoutWritePermission) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.txt";
  EXPECT_FALSE(replace_file(path, "old"));
  fs::permissions(path, fs::perms{0444});
  const uid_t user = ::geteuid();
  if (user == 0) {  // who may write everything
    constexpr uid_t kNobody = 65534;
    fs::permissions(folder.path(), fs::perms::all);
    ASSERT_EQ(::seteuid(kNobody), 0);
  }
  EXPECT_EQ(replace_file(path, "new"), std::errc::permission_denied);
  EXPECT_THROW(common::prepare_output("--save", path, common::part_of(path)), common::UserError);
  ASSERT_EQ(::seteuid(user), 0);
  EXPECT_EQ(content(path), "old");
  EXPECT_EQ(folder.entries(), 1);
}

TEST(AtomicFile, PipeWithoutReaderIsRefused) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "pipe";
  ASSERT_EQ(::mkfifo(path.c_str(), 0600), 0);
  EXPECT_EQ(replace_file(path, "x"), std::errc::broken_pipe);
  const int reader = ::open(path.c_str(), O_RDONLY | O_NONBLOCK);
  EXPECT_FALSE(replace_file(path, "x"));
  char byte = 0;
  EXPECT_EQ(::read(reader, &byte, 1), 1);
  EXPECT_EQ(byte, 'x');
  ::close(reader);
}

TEST(AtomicFile, FailureLeavesNoTemporaryFile) {
  const TemporaryFolder folder;
  EXPECT_EQ(replace_file(folder.path() / "missing" / "a.txt", "x"), std::errc::no_such_file_or_directory);
  fs::create_directory(folder.path() / "b");
  EXPECT_EQ(replace_file(folder.path() / "b", "x"), std::errc::is_a_directory);
  EXPECT_EQ(folder.entries(), 1);
}

TEST(AtomicFile, WritesLinksAndDevicesInPlace) {
  const TemporaryFolder folder;
  const fs::path target = folder.path() / "target", link = folder.path() / "link";
  std::ofstream(target) << "old";
  fs::create_symlink(target, link);
  EXPECT_TRUE(common::is_special_file(link));
  EXPECT_FALSE(replace_file(link, "new"));
  EXPECT_TRUE(fs::is_symlink(link));
  EXPECT_EQ(content(target), "new");
  EXPECT_FALSE(replace_file("/dev/null", "swallowed"));
  EXPECT_EQ(replace_file("/dev/full", "x"), std::errc::no_space_on_device);
}

TEST(AtomicFile, WritesToOpenDescriptorsWhereTheyStand) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.txt";
  for (const int append : {0, O_APPEND}) {
    std::ofstream(path) << "old ";
    const int file = ::open(path.c_str(), O_WRONLY | append);
    ASSERT_EQ(::lseek(file, 0, SEEK_END), 4);
    for (const char* const descriptors : {"/dev/fd/", "/proc/self/fd/"})
      EXPECT_FALSE(replace_file(descriptors + std::to_string(file), "new "));
    ASSERT_EQ(::write(file, "end", 3), 3);
    ::close(file);
    EXPECT_EQ(content(path), "old new new end");
  }
  EXPECT_EQ(replace_file("/dev/fd/-1", "x"), std::errc::bad_file_descriptor);
}

}  // namespace

#include "common/video/VideoEncoder.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>

#include "common/error/UserError.h"
#include "common/files/AtomicFile.h"
#include "common/process/Termination.h"
#include "tests/unit/common/TemporaryFolder.h"

namespace fs = std::filesystem;
using common::Image;
using common::UserError;
using common::VideoEncoder;

namespace {

// Puts a shell script named ffmpeg first in PATH. $last is the output file.
class FakeFfmpeg {
 public:
  explicit FakeFfmpeg(const std::string& body) : old_path_(std::getenv("PATH")) {
    const fs::path program = folder_.path() / "ffmpeg";
    std::ofstream(program) << "#!/bin/sh\nfor last; do :; done\n" << body << "\n";
    fs::permissions(program, fs::perms::owner_all);
    ::setenv("PATH", (folder_.path().string() + ":" + old_path_).c_str(), 1);
  }
  ~FakeFfmpeg() { ::setenv("PATH", old_path_.c_str(), 1); }

 private:
  TemporaryFolder folder_;
  std::string old_path_;
};

Image grey(int width, int height) {
  return {width, height, std::vector<std::uint8_t>(static_cast<std::size_t>(width * height) * 3, 128)};
}

TEST(VideoEncoder, RenamesFinishedVideo) {
  const FakeFfmpeg ffmpeg("cat > \"$last\"");
  const TemporaryFolder folder;
  VideoEncoder video(folder.path() / "a.mp4", 4, 2, 30);
  video.add(grey(4, 2));
  video.add(grey(4, 2));
  video.finish();
  EXPECT_EQ(fs::file_size(folder.path() / "a.mp4"), 2U * 4 * 2 * 3);
  EXPECT_EQ(folder.entries(), 1);
}

std::string content(const fs::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

TEST(VideoEncoder, WritesThroughNoLinkAndOverNoFile) {
  const FakeFfmpeg ffmpeg("cat > \"$last\"");
  const TemporaryFolder folder;
  const fs::path own = folder.path() / "own", video = folder.path() / "a.mp4";
  std::ofstream(own) << "own";
  const auto encode = [&] {
    VideoEncoder encoder(video, 4, 2, 30);
    encoder.add(grey(4, 2));
    encoder.finish();
    EXPECT_EQ(fs::file_size(video), 4U * 2 * 3);
    EXPECT_EQ(content(own), "own");
  };
  fs::create_symlink(own, common::part_of(video));
  encode();
  fs::create_hard_link(own, common::part_of(video));
  encode();
  EXPECT_EQ(folder.entries(), 2);
}

TEST(VideoEncoder, LinkStaysAndItsTargetIsReplaced) {
  const FakeFfmpeg ffmpeg("cat > \"$last\"");
  const TemporaryFolder folder;
  const fs::path link = folder.path() / "a.mp4", target = folder.path() / "target.mp4";
  fs::create_symlink("target.mp4", link);
  for (const bool is_there : {false, true}) {
    EXPECT_EQ(fs::exists(target), is_there);
    VideoEncoder encoder(link, 4, 2, 30);
    encoder.add(grey(4, 2));
    encoder.finish();
    EXPECT_TRUE(fs::is_symlink(link));
    EXPECT_EQ(fs::file_size(target), 4U * 2 * 3);
  }
  EXPECT_EQ(folder.entries(), 2);
}

TEST(VideoEncoder, RefusesWhatIsNoFileAndTellsLostPart) {
  const FakeFfmpeg ffmpeg("cat > \"$last\"");
  const TemporaryFolder folder;
  const fs::path video = folder.path() / "a.mp4", part = common::part_of(video);
  ASSERT_EQ(::mkfifo(video.c_str(), 0600), 0);
  EXPECT_THROW(VideoEncoder(video, 4, 2, 30), UserError);
  fs::remove(video);
  for (const bool is_replaced : {false, true}) {
    VideoEncoder encoder(video, 4, 2, 30);
    encoder.add(grey(4, 2));
    fs::remove(part);
    if (is_replaced) std::ofstream(part) << "another";
    try {
      encoder.finish();
      ADD_FAILURE();
    } catch (const UserError& error) {
      EXPECT_NE(std::string(error.what()).find("removed or replaced"), std::string::npos) << error.what();
    }
    EXPECT_FALSE(fs::exists(video));
  }
}

// ffmpeg ends at Ctrl-C, whatever it inherits, and the terminal sends it to the whole process group.
TEST(VideoEncoder, HasAProcessGroupOfItsOwn) {
  const FakeFfmpeg ffmpeg("cut -d' ' -f5 /proc/$$/stat > \"$last\"; echo $$ >> \"$last\"; cat > /dev/null");
  const TemporaryFolder folder;
  VideoEncoder video(folder.path() / "a.mp4", 4, 2, 30);
  video.add(grey(4, 2));
  video.finish();
  int group = 0, process = 0;
  std::ifstream(folder.path() / "a.mp4") >> group >> process;
  EXPECT_GT(process, 0);
  EXPECT_EQ(group, process);
}

TEST(VideoEncoder, FailureLeavesNoPartialFile) {
  const FakeFfmpeg ffmpeg("cat > \"$last\"; exit 1");
  const TemporaryFolder folder;
  VideoEncoder video(folder.path() / "a.mp4", 4, 2, 30);
  video.add(grey(4, 2));
  EXPECT_THROW(video.finish(), UserError);
  EXPECT_EQ(folder.entries(), 0);
}

TEST(VideoEncoder, CrashOfItsProgramLeavesNoPartialFile) {
#ifdef __SANITIZE_THREAD__
  GTEST_SKIP() << "ThreadSanitizer calls signal handlers with an errno of its own";
#endif
  const FakeFfmpeg ffmpeg("cat > \"$last\"");
  const TemporaryFolder folder;
  const auto crash = [&] {
    std::signal(SIGSEGV, SIG_DFL);  // instead of a sanitizer's handler
    const common::Termination termination("program");
    const VideoEncoder video(folder.path() / "a.mp4", 4, 2, 30);
    while (folder.entries() == 0) std::this_thread::yield();
    errno = ENOMEM;
    std::raise(SIGSEGV);
  };
  EXPECT_EXIT(crash(), testing::ExitedWithCode(1), "^program: there is not enough memory\n$");
  EXPECT_EQ(folder.entries(), 0);
}

TEST(VideoEncoder, ReportsEarlyExitOfFfmpeg) {
  const FakeFfmpeg ffmpeg("echo part > \"$last\"; exit 1");
  const TemporaryFolder folder;
  {
    VideoEncoder video(folder.path() / "a.mp4", 640, 480, 30);
    EXPECT_THROW(
        {
          for (int i = 0; i < 1000; ++i) video.add(grey(640, 480));
          video.finish();
        },
        UserError);
  }
  EXPECT_EQ(folder.entries(), 0);
}

TEST(VideoEncoder, DiscardsUnfinishedVideo) {
  const FakeFfmpeg ffmpeg("cat > \"$last\"");
  const TemporaryFolder folder;
  VideoEncoder(folder.path() / "a.mp4", 4, 2, 30).add(grey(4, 2));
  EXPECT_EQ(folder.entries(), 0);
}

TEST(VideoEncoder, RejectsInvalidNamesAndFolders) {
  const FakeFfmpeg ffmpeg("cat > \"$last\"");
  const TemporaryFolder folder;
  EXPECT_THROW(VideoEncoder(folder.path() / "a.avi", 4, 2, 30), UserError);
  EXPECT_THROW(VideoEncoder(folder.path() / "missing" / "a.mp4", 4, 2, 30), UserError);
}

}  // namespace

#include "common/video/VideoEncoder.h"

#include <fcntl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cassert>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include "common/error/UserError.h"
#include "common/files/ProgramOnPath.h"
#include "common/process/Supervisor.h"

namespace common {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

// Writes to the open descriptor, so that ffmpeg follows no name that somebody else may have changed.
std::vector<std::string> ffmpeg_command(int file, int width, int height, int frames_per_second) {
  const std::string size = std::to_string(width) + "x" + std::to_string(height);
  const std::string rate = std::to_string(frames_per_second);
  std::vector<std::string> words{"ffmpeg", "-nostdin", "-loglevel", "error", "-y"};
  words.insert(words.end(), {"-f", "rawvideo", "-pix_fmt", "rgb24", "-s", size, "-r", rate, "-i", "pipe:0"});
  words.insert(words.end(), {"-an", "-c:v", "libx264", "-preset", "veryfast", "-crf", "18"});
  words.insert(words.end(), {"-pix_fmt", "yuv420p", "-f", "mp4"});
  words.push_back("/proc/self/fd/" + std::to_string(file));
  return words;
}

std::string failure(int wait_status, const char* other) {
  const bool stalled = WIFEXITED(wait_status) && WEXITSTATUS(wait_status) == kStalled;
  return stalled ? "ffmpeg made no progress, and was ended" : other;
}

}  // namespace

VideoEncoder::VideoEncoder(const fs::path& file, int width, int height, int frames_per_second)
    : file_(file), width_(width), height_(height) {
  assert(width % 2 == 0 && height % 2 == 0);
  const std::string name = file.string();
  if (file.extension() != ".mp4") throw UserError(name + ": a video's name must end in .mp4");
  const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  if (!fs::is_directory(folder)) throw UserError(name + ": there is no folder " + folder.string());
  if (program_on_path("ffmpeg").empty())
    throw UserError(name + ": a video needs ffmpeg, which is not installed (apt-get install ffmpeg)");
  part_.emplace(file);
  start(frames_per_second);
}

void VideoEncoder::start(int frames_per_second) {
  const std::vector<std::string> command =
      ffmpeg_command(part_->descriptor(), width_, height_, frames_per_second);
  // A socket rather than a pipe: send() can suppress SIGPIPE for this descriptor alone.
  std::array<int, 2> ends{};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0)
    throw UserError(file_.string() + ": cannot start ffmpeg: " + std::strerror(errno));
  const pid_t parent = ::getpid();
  child_ = ::fork();
  if (child_ == 0)
    supervise({.parent = parent,
               .become_command =
                   [&](pid_t supervisor) {
                     ::dup2(ends[0], STDIN_FILENO);
                     ::fcntl(part_->descriptor(), F_SETFD, 0);
                     // A process group without the terminal's Ctrl-C, which ffmpeg would catch: it ends with
                     // its input.
                     ::setpgid(0, 0);
                     // Its threads, which ffmpeg does not need, wait for ever for memory that is not there.
                     ::setenv("OPENBLAS_NUM_THREADS", "1", 1);
                     execute(command, supervisor, SIGKILL);
                     ::_exit(127);
                   },
               .input = ends[0],
               .grace_without_parent = 0ms,
               .at_end_without_parent = [this] { ::unlink(part_->path().c_str()); }});
  const int fork_error = errno;
  ::close(ends[0]);
  socket_ = ends[1];
  if (child_ > 0) return;
  ::close(socket_);
  throw UserError(file_.string() + ": cannot start ffmpeg: " + std::strerror(fork_error));
}

// Ends ffmpeg's input and returns its wait status, or -1 when it was not running.
int VideoEncoder::close_and_wait() {
  if (socket_ >= 0) {
    ::shutdown(socket_, SHUT_WR);  // other processes of the run may hold the socket, too
    ::close(socket_);
  }
  socket_ = -1;
  int status = -1;
  if (child_ > 0)
    while (::waitpid(child_, &status, 0) < 0 && errno == EINTR) {
    }
  child_ = -1;
  return status;
}

int VideoEncoder::abandon() {
  if (child_ < 0) return -1;
  const int status = close_and_wait();
  part_.reset();
  return status;
}

VideoEncoder::~VideoEncoder() { abandon(); }

void VideoEncoder::add(const Image& image) {
  assert(image.width == width_ && image.height == height_);
  if (child_ < 0) return;  // it has failed before
  const std::uint8_t* bytes = image.rgb.data();
  for (std::size_t left = image.rgb.size(); left > 0;) {
    const ssize_t n = ::send(socket_, bytes, left, MSG_NOSIGNAL);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) {
      throw UserError(file_.string() + ": " + failure(abandon(), "ffmpeg stopped taking pictures"));
    }
    bytes += n;
    left -= n;
  }
}

void VideoEncoder::finish() {
  if (child_ < 0) return;
  const int status = close_and_wait();
  const std::error_code error = status == 0 ? part_->commit() : std::error_code();
  part_.reset();
  if (status != 0) throw UserError(file_.string() + ": " + failure(status, "ffmpeg failed"));
  if (error) throw UserError(file_.string() + ": cannot be written: " + error.message());
}

}  // namespace common

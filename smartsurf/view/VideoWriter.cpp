#include "smartsurf/view/VideoWriter.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cassert>
#include <cerrno>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::view {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> command(const fs::path& part, int width, int height, int frames_per_second) {
  return {"ffmpeg",
          "-nostdin",
          "-loglevel",
          "error",
          "-y",
          "-f",
          "rawvideo",
          "-pix_fmt",
          "rgb24",
          "-s",
          std::to_string(width) + "x" + std::to_string(height),
          "-r",
          std::to_string(frames_per_second),
          "-i",
          "pipe:0",
          "-an",
          "-c:v",
          "libx264",
          "-preset",
          "veryfast",
          "-crf",
          "20",
          "-pix_fmt",
          "yuv420p",
          part.string()};
}

// Whether the program is somewhere on PATH.
bool installed(const std::string& program) {
  const char* path = getenv("PATH");
  std::string folders = path ? path : "";
  for (std::size_t from = 0; from <= folders.size();) {
    const std::size_t to = std::min(folders.find(':', from), folders.size());
    if (access((folders.substr(from, to - from) + "/" + program).c_str(), X_OK) == 0) return true;
    from = to + 1;
  }
  return false;
}

}  // namespace

struct VideoWriter::Pipe {
  fs::path file, part;
  int width, height;
  pid_t child = -1;
  int descriptor = -1;

  void start(int frames_per_second) {
    const auto words = command(part, width, height, frames_per_second);
    std::vector<char*> arguments;
    for (const auto& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
    arguments.push_back(nullptr);
    std::array<int, 2> ends{};
    if (pipe2(ends.data(), O_CLOEXEC) != 0) throw std::system_error(errno, std::generic_category(), "video");
    child = fork();
    if (child < 0) throw std::system_error(errno, std::generic_category(), "video");
    if (child == 0) {
      dup2(ends[0], STDIN_FILENO);
      // Ctrl-C is for the simulator: ffmpeg ends when its pictures do.
      signal(SIGINT, SIG_IGN);
      execvp(arguments[0], arguments.data());
      _exit(127);
    }
    close(ends[0]);
    descriptor = ends[1];
  }

  // ffmpeg's exit status, once it has seen the end of its pictures.
  int end() {
    if (descriptor >= 0) close(descriptor);
    descriptor = -1;
    int status = 0;
    if (child > 0) waitpid(child, &status, 0);
    child = -1;
    return status;
  }
};

VideoWriter::VideoWriter(const fs::path& file, int width, int height, int frames_per_second)
    : pipe_(std::make_unique<Pipe>()) {
  assert(width % 2 == 0 && height % 2 == 0);
  if (file.extension() != ".mp4")
    throw scene::InputError(file.string() + ": a video's name must end in .mp4");
  const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  if (!fs::is_directory(folder))
    throw scene::InputError(file.string() + ": there is no folder " + folder.string());
  if (!installed("ffmpeg"))
    throw scene::InputError(file.string() +
                            ": a video needs ffmpeg, which is not installed (apt-get install ffmpeg)");
  pipe_->file = file;
  pipe_->part = file.string() + ".part.mp4";
  pipe_->width = width;
  pipe_->height = height;
  pipe_->start(frames_per_second);
}

VideoWriter::~VideoWriter() {
  if (pipe_->child < 0) return;
  pipe_->end();
  std::error_code ignored;
  fs::remove(pipe_->part, ignored);
}

void VideoWriter::add(const Image& image) {
  assert(image.width == pipe_->width && image.height == pipe_->height);
  const std::uint8_t* bytes = image.rgb.data();
  for (std::size_t left = image.rgb.size(); left > 0;) {
    const ssize_t n = write(pipe_->descriptor, bytes, left);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) throw std::runtime_error(pipe_->file.string() + ": ffmpeg stopped taking pictures");
    bytes += n;
    left -= static_cast<std::size_t>(n);
  }
}

void VideoWriter::finish() {
  if (pipe_->end() != 0) throw std::runtime_error(pipe_->file.string() + ": ffmpeg failed");
  fs::rename(pipe_->part, pipe_->file);
}

}  // namespace smartsurf::view

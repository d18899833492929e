#include "apron/ui/Film.h"

#include <fcntl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

namespace apron::ui {
namespace {

namespace fs = std::filesystem;

bool on_path(const std::string& program) {
  const char* path = std::getenv("PATH");
  const std::string folders = path != nullptr ? path : "";
  for (std::size_t from = 0; from <= folders.size();) {
    const std::size_t to = std::min(folders.find(':', from), folders.size());
    if (access((folders.substr(from, to - from) + "/" + program).c_str(), X_OK) == 0) return true;
    from = to + 1;
  }
  return false;
}

std::vector<std::string> command(const fs::path& file, int width, int height, int frames_per_second) {
  const std::string size = std::to_string(width) + "x" + std::to_string(height);
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
          size,
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
          "18",
          "-pix_fmt",
          "yuv420p",
          file.string()};
}

}  // namespace

Film::Film(const fs::path& file, int width, int height, int frames_per_second)
    : file_(file), part_(file.string() + ".part.mp4") {
  const std::string name = file.string();
  if (file.extension() != ".mp4") throw PictureError(name + ": a video's name must end in .mp4");
  const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  if (!fs::is_directory(folder)) throw PictureError(name + ": there is no folder " + folder.string());
  if (!on_path("ffmpeg"))
    throw PictureError(name + ": a video needs ffmpeg, which is not installed (apt-get install ffmpeg)");
  start(width, height, frames_per_second);
}

void Film::start(int width, int height, int frames_per_second) {
  const std::vector<std::string> words = command(part_, width, height, frames_per_second);
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  // A socket and not a pipe: writing to it can be told not to raise SIGPIPE.
  std::array<int, 2> ends{};
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0)
    throw PictureError(file_.string() + ": " + std::strerror(errno));
  child_ = fork();
  if (child_ == 0) {
    dup2(ends[0], STDIN_FILENO);
    std::signal(SIGINT, SIG_IGN);  // ffmpeg ends when its pictures do
    execvp(arguments[0], arguments.data());
    _exit(127);
  }
  close(ends[0]);
  pipe_ = ends[1];
  if (child_ < 0) throw PictureError(file_.string() + ": cannot start ffmpeg");
}

// ffmpeg's status, once it has seen the end of its pictures.
int Film::end() {
  if (pipe_ >= 0) close(pipe_);
  pipe_ = -1;
  int status = -1;
  if (child_ > 0) waitpid(child_, &status, 0);
  child_ = -1;
  return status;
}

Film::~Film() {
  if (child_ < 0) return;
  end();
  std::error_code ignored;
  fs::remove(part_, ignored);
}

void Film::add(const Image& image) {
  const std::uint8_t* bytes = image.rgb.data();
  for (std::size_t left = image.rgb.size(); left > 0;) {
    const ssize_t n = send(pipe_, bytes, left, MSG_NOSIGNAL);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) throw PictureError(file_.string() + ": ffmpeg stopped taking pictures");
    bytes += n;
    left -= static_cast<std::size_t>(n);
  }
}

void Film::finish() {
  const bool made = end() == 0;
  std::error_code error;
  if (made) fs::rename(part_, file_, error);
  if (made && !error) return;
  fs::remove(part_, error);
  throw PictureError(file_.string() + ": ffmpeg failed");
}

}  // namespace apron::ui

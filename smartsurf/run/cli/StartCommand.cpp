#include "smartsurf/run/cli/StartCommand.h"

#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "common/error/UserError.h"
#include "common/files/Installation.h"
#include "common/files/ReadFile.h"
#include "common/files/UserFile.h"
#include "common/image/Png.h"
#include "common/process/Arguments.h"
#include "common/process/ExitStatus.h"
#include "common/process/StopSignals.h"
#include "smartsurf/run/options/RunOptions.h"
#include "smartsurf/view/window/StartScreen.h"

namespace smartsurf::run {
namespace {

namespace fs = std::filesystem;

constexpr const char* kRecentFile = "recent";
constexpr std::size_t kMaxRecent = 10;

std::vector<std::string> read_recent() {
  std::vector<std::string> files;
  std::istringstream lines(common::read_user_file(kRecentFile));
  std::error_code ignored;
  for (std::string line; std::getline(lines, line) && files.size() < kMaxRecent;)
    if (fs::is_regular_file(line, ignored)) files.push_back(line);
  return files;
}

// One line an experiment: section, file below the folder, title, separated by tabs. Without the files, the
// gallery is empty.
view::StartContents read_contents() {
  view::StartContents contents;
  contents.recent = read_recent();
  const fs::path gallery = common::installed_file("gallery"), folder = gallery.parent_path();
  std::string text;
  if (gallery.empty() || common::read_file(gallery / "gallery.tsv", common::kMaxTextBytes, text))
    return contents;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream fields(line);
    view::GalleryItem item;
    std::string file;
    if (!std::getline(fields, item.section, '\t') || !std::getline(fields, file, '\t') ||
        !std::getline(fields, item.title, '\t'))
      continue;
    item.file = (folder / file).string();
    contents.items.push_back(std::move(item));
  }
  try {
    contents.tiles = common::read_png(gallery / "gallery.png");
  } catch (const common::UserError& error) {
    contents.message = error.what();
  }
  return contents;
}

std::vector<std::string> command_for(const std::string& file) {
  const std::string self = common::program_path().string();
  if (!file.ends_with(".lua")) return {self, "replay", file};
  const RunOptions options = options_for_opened(file, {});
  if (options.no_controller) return {self, "run", file, "--window", "--no-controller"};
  return {self, "run", file, "--window", "--controller", options.controller};
}

// Passes what the child writes to standard error on, and returns the last line if the child fails. Ends it on
// `stop`.
std::string run_and_wait(const std::vector<std::string>& command, const std::atomic<bool>& stop) {
  std::vector<char*> arguments = common::argument_pointers(command);
  std::array<int, 2> errors{};
  if (pipe(errors.data()) != 0)
    throw std::system_error(errno, std::generic_category(), "cannot start the run");
  const pid_t parent = getpid(), child = fork();
  if (child < 0) throw std::system_error(errno, std::generic_category(), "cannot start the run");
  if (child == 0) {
    setenv("SMARTSURF_PARENT", std::to_string(parent).c_str(), 1);
    dup2(errors[1], STDERR_FILENO);
    close(errors[0]);
    close(errors[1]);
    execv(arguments[0], arguments.data());
    _exit(common::kFailed);
  }
  close(errors[1]);
  std::string line, last;
  char byte = 0;
  bool told = false;
  while (true) {
    constexpr int kTimeout_ms = 100;
    pollfd ready{errors[0], POLLIN, 0};
    const int events = poll(&ready, 1, kTimeout_ms);
    if (stop && !std::exchange(told, true)) kill(child, SIGTERM);
    if (events <= 0) continue;
    if (read(errors[0], &byte, 1) != 1) break;
    if (write(STDERR_FILENO, &byte, 1) < 0) continue;  // a closed terminal does not end the run
    if (byte != '\n') {
      line += byte;
    } else if (!line.empty()) {
      last = std::exchange(line, "");
    }
  }
  close(errors[0]);
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) && WEXITSTATUS(status) == common::kDone ? "" : last;
}

}  // namespace

void note_recent(const std::string& file) {
  std::error_code error;
  const std::string path = fs::absolute(file, error).lexically_normal().string();
  if (error || path.find('\n') != path.npos) return;
  std::vector<std::string> files = read_recent();
  std::erase(files, path);
  files.insert(files.begin(), path);
  if (files.size() > kMaxRecent) files.resize(kMaxRecent);
  std::string text;
  for (const std::string& line : files) text += line + "\n";
  common::write_user_file(kRecentFile, text);
}

int start_command() {
  const auto& stop = common::catch_stop_signals();
  std::string message;
  while (true) {
    view::StartContents contents = read_contents();
    if (!message.empty()) contents.message = message;
    const std::string file = view::choose_file(contents, stop);
    if (file.empty()) return common::status_after_signals(common::kDone);
    message = run_and_wait(command_for(file), stop);
    if (stop) return common::status_after_signals(common::kDone);
  }
}

}  // namespace smartsurf::run

// The programs under test, run as a user runs them.
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

namespace hardware {

// One process; killed and reaped at the end. What it prints goes to a file.
class Program {
 public:
  explicit Program(std::vector<std::string> words) {
    static int count = 0;
    file_ = ::testing::TempDir() + "hardware-" + std::to_string(::getpid()) + "-" + std::to_string(count++);
    pid_ = ::fork();
    if (pid_ != 0) return;
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    const int out = ::open(file_.c_str(), O_CREAT | O_TRUNC | O_WRONLY | O_CLOEXEC, 0600);
    ::dup2(out, 1);
    ::dup2(out, 2);
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    ::execv(arguments[0], arguments.data());
    ::_exit(127);
  }
  ~Program() {
    if (!reaped_) {
      signal(SIGKILL);
      wait();
    }
    ::unlink(file_.c_str());
  }
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  void signal(int number) const { ::kill(pid_, number); }
  void suspend() const {
    signal(SIGSTOP);
    ::waitpid(pid_, nullptr, WUNTRACED);
  }
  pid_t pid() const { return pid_; }
  // Its exit status, or minus the signal that ended it.
  int wait() {
    int status = 0;
    ::waitpid(pid_, &status, 0);
    reaped_ = true;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }
  std::string output() const {
    std::ifstream in(file_);
    std::ostringstream text;
    text << in.rdbuf();
    return text.str();
  }
  // How often it printed this.
  std::size_t count_output(const std::string& what) const {
    const std::string text = output();
    std::size_t count = 0;
    for (std::size_t at = text.find(what); at != text.npos; at = text.find(what, at + 1)) ++count;
    return count;
  }
  // Waits until it printed this (a test's own time-out ends it) and returns the rest of that line.
  std::string await_output(const std::string& what) const {
    for (;;) {
      const std::string text = output();
      const std::size_t at = text.find(what);
      const std::size_t end = at == std::string::npos ? at : text.find('\n', at);
      if (end != std::string::npos) return text.substr(at + what.size(), end - at - what.size());
      ::usleep(2000);
    }
  }
  // The number after that word of the bridge's summary.
  unsigned long long figure(const std::string& word) const {
    const std::string text = output();
    const std::size_t line = text.rfind("frames ");
    const std::size_t at = line == std::string::npos ? line : text.find(word + " ", line);
    if (at == std::string::npos) {
      ADD_FAILURE() << "no " << word << " in: " << text;
      return 0;
    }
    return std::strtoull(text.c_str() + at + word.size() + 1, nullptr, 10);
  }

 private:
  pid_t pid_ = 0;
  bool reaped_ = false;
  std::string file_;
};

inline std::string surface_name(const std::string& what) {
  return "test-" + what + "-" + std::to_string(::getpid());
}
inline std::string segment_path(const std::string& name) { return "/dev/shm/smartsurf." + name; }
inline bool segment_exists(const std::string& name) {
  return ::access(segment_path(name).c_str(), F_OK) == 0;
}
inline std::string line_path(const std::string& what) {
  return ::testing::TempDir() + "line-" + what + "-" + std::to_string(::getpid());
}

// The emulator with its line; the name of the line once it is there.
struct Device {
  explicit Device(std::vector<std::string> flags) : program(with_program(std::move(flags))) {
    name = program.await_output("device ");
  }
  ~Device() {
    if (std::filesystem::is_symlink(name)) std::filesystem::remove(name);
  }
  static std::vector<std::string> with_program(std::vector<std::string> flags) {
    flags.insert(flags.begin(), DEVICE_EMULATOR);
    return flags;
  }
  Program program;
  std::string name;
};

}  // namespace hardware

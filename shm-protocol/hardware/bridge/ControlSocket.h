// How other processes stop a running bridge and ask for its status: a local socket in the abstract namespace,
// named after surface and user. Only processes of the same user, or root, are answered.
#pragma once

#include <chrono>
#include <functional>
#include <string>
#include <vector>

namespace hardware {

// The answer to a command. `then` runs after the answer has arrived: a caller that has given up or ended has
// told its user that nothing was done.
struct ControlAnswer {
  std::string text;
  std::function<void()> then = {};
};

// The bridge's end. Never blocks.
class ControlSocket {
 public:
  // Throws std::runtime_error if the name is taken.
  explicit ControlSocket(const std::string& surface);
  ~ControlSocket();
  ControlSocket(const ControlSocket&) = delete;
  ControlSocket& operator=(const ControlSocket&) = delete;

  int descriptor() const { return listener_; }
  // Answers every waiting process with answer(command).
  void serve(const std::function<ControlAnswer(const std::string& command)>& answer);

 private:
  int listener_ = -1;
  std::vector<int> clients_;
};

// Sends a command to the bridge of that surface and returns its answer. Throws std::runtime_error with one
// line if there is no such bridge, or it does not answer in time.
std::string ask_bridge(const std::string& surface, const std::string& command,
                       std::chrono::milliseconds patience = std::chrono::seconds(10));

// The emergency stop of all bridges that this user runs on this computer: what was stopped, or could not be,
// as one line for a window. All are told before any answer is awaited.
std::string stop_all_bridges();

}  // namespace hardware

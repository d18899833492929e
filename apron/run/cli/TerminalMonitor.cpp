#include "apron/run/cli/TerminalMonitor.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>

namespace apron::run {
namespace {

constexpr std::chrono::milliseconds kMinFrameInterval{50};
constexpr std::uint32_t kReservedRows = 6;  // for the headline and the program's output

void write_stdout(const std::string& text) {
  std::fwrite(text.data(), 1, text.size(), stdout);
  std::fflush(stdout);
}

TerminalSize terminal_size() {
  winsize window{};
  const bool known = ioctl(STDOUT_FILENO, TIOCGWINSZ, &window) == 0 && window.ws_col > 0 && window.ws_row > 0;
  return known ? TerminalSize{window.ws_col, window.ws_row} : TerminalSize{};
}

// Rows of text occupied by the headline and the picture.
std::uint32_t count_rows(const std::string& frame) {
  return static_cast<std::uint32_t>(std::ranges::count(frame, '\n'));
}

}  // namespace

TerminalMonitor::TerminalMonitor(const vm::Vm& vm, const std::string& name)
    : vm_(vm),
      register_(*program::find_register(vm.program(), name)),
      is_terminal_(isatty(STDOUT_FILENO) == 1),
      size_(is_terminal_ ? terminal_size() : TerminalSize{}) {
  if (is_terminal_) size_.rows = std::max(size_.rows, kReservedRows + 2) - kReservedRows;
}

TerminalMonitor::~TerminalMonitor() { finish(); }

void TerminalMonitor::update() {
  if (!is_terminal_ || Clock::now() < next_draw_) return;
  draw();
  next_draw_ = Clock::now() + kMinFrameInterval;
}

std::string TerminalMonitor::headline() const {
  const vm::Plane plane = vm_.plane(register_);
  return fmt::format("{} {}x{}\n", vm_.program().registers[register_].name, plane.width, plane.height);
}

// The first call clears the screen and restricts scrolling to the rows below the picture (DECSTBM).
void TerminalMonitor::draw() {
  const std::string frame = headline() + render_ansi(vm_.plane(register_), size_);
  const std::uint32_t first_free_row = count_rows(frame) + 1;
  if (!screen_prepared_) {
    write_stdout(fmt::format("\x1b[2J\x1b[{}r\x1b[{};1H", first_free_row, first_free_row));
    screen_prepared_ = true;
  }
  write_stdout(
      "\x1b"
      "7\x1b[H" +
      frame +
      "\x1b"
      "8");
}

void TerminalMonitor::finish() {
  if (finished_) return;
  finished_ = true;
  if (!is_terminal_) return write_stdout(headline() + render_ascii(vm_.plane(register_), size_));
  draw();
  write_stdout(
      "\x1b"
      "7\x1b[r\x1b"
      "8\n");
}

}  // namespace apron::run

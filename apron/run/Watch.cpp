#include "apron/run/Watch.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <vector>

#include "apron/syntax/Suggestion.h"

namespace apron::run {
namespace {

constexpr std::chrono::milliseconds kBetweenFrames{50};
constexpr std::uint32_t kTextRows = 6;  // that the picture leaves to the program's output

void write(const std::string& text) {
  std::fwrite(text.data(), 1, text.size(), stdout);
  std::fflush(stdout);
}

PictureSize terminal_size() {
  winsize window{};
  const bool known = ioctl(STDOUT_FILENO, TIOCGWINSZ, &window) == 0 && window.ws_col > 0 && window.ws_row > 0;
  return known ? PictureSize{window.ws_col, window.ws_row} : PictureSize{};
}

// Rows of text that the picture and its headline take.
std::uint32_t rows_of(const std::string& frame) {
  return static_cast<std::uint32_t>(std::count(frame.begin(), frame.end(), '\n'));
}

}  // namespace

std::string Watch::unknown(const program::Program& program, const std::string& name) {
  std::vector<std::string> known;
  for (const program::Register& r : program.registers) {
    if (r.name == name) return {};
    if (r.name.substr(0, 1) != "$") known.push_back(r.name);
  }
  return "--watch: the program has no register '" + name + "'" + syntax::did_you_mean(name, known);
}

Watch::Watch(const vm::Vm& vm, const std::string& name)
    : vm_(vm), live_(isatty(STDOUT_FILENO) == 1), size_(live_ ? terminal_size() : PictureSize{}) {
  while (vm.program().registers[register_].name != name) ++register_;
  if (live_) size_.rows = std::max(size_.rows, kTextRows + 2) - kTextRows;
}

Watch::~Watch() { finish(); }

void Watch::look() {
  if (!live_ || Clock::now() < next_) return;
  draw_live();
  next_ = Clock::now() + kBetweenFrames;
}

std::string Watch::headline() const {
  const vm::Plane plane = vm_.plane(register_);
  return fmt::format("{} {}x{}\n", vm_.program().registers[register_].name, plane.width, plane.height);
}

// The first time on a cleared screen, whose lower part alone scrolls from then on.
void Watch::draw_live() {
  const std::string frame = headline() + coloured_picture(vm_.plane(register_), size_);
  const std::uint32_t below = rows_of(frame) + 1;
  if (!started_) {
    write(fmt::format("\x1b[2J\x1b[{}r\x1b[{};1H", below, below));
    started_ = true;
  }
  write(
      "\x1b"
      "7\x1b[H" +
      frame +
      "\x1b"
      "8");
}

void Watch::finish() {
  if (finished_) return;
  finished_ = true;
  if (!live_) return write(headline() + plain_picture(vm_.plane(register_), size_));
  draw_live();
  write(
      "\x1b"
      "7\x1b[r\x1b"
      "8\n");
}

}  // namespace apron::run

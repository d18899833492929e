// Shows a register while its program runs (`run --watch`): live in a terminal, else once, at the end.
#pragma once

#include <chrono>
#include <string>

#include "apron/program/Program.h"
#include "apron/run/Picture.h"
#include "apron/vm/Vm.h"

namespace apron::run {

// In a terminal the upper part is the picture's, and what the program prints scrolls below it.
class Watch {
 public:
  // "" or what is wrong: no register is called that.
  static std::string unknown(const program::Program& program, const std::string& name);

  // name: a register of the VM's program, which must outlive this. Writes to stdout.
  Watch(const vm::Vm& vm, const std::string& name);
  ~Watch();
  Watch(const Watch&) = delete;
  Watch& operator=(const Watch&) = delete;

  // In a terminal, draws unless it did less than 1/20 s ago.
  void look();
  // Draws, and in a terminal sets the cursor below.
  void finish();

 private:
  using Clock = std::chrono::steady_clock;
  std::string headline() const;
  void draw_live();

  const vm::Vm& vm_;
  std::size_t register_ = 0;
  bool live_;
  bool started_ = false, finished_ = false;
  PictureSize size_;
  Clock::time_point next_ = Clock::now();
};

}  // namespace apron::run

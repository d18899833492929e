// `apron run --show-registers DESCRIPTOR:NAMES[:DRAWN]`: the program's registers as the simulator that
// started it records and draws them.
#pragma once

#include <string>
#include <vector>

#include "apron/program/Program.h"
#include "apron/vm/Vm.h"

namespace apron::run {

class RegisterView {
 public:
  // names: of --record-registers, separated by commas; the first may be "all", which is every named register
  // of the surface's size. drawn: that of --cells. Each may be "". Throws common::UserError if the program
  // has no such register, or one of another size.
  RegisterView(int descriptor, const std::string& names, const std::string& drawn,
               const program::Program& program, std::uint32_t width, std::uint32_t height);

  // Writes the registers as they are. A register that the program no longer has, because it was edited, is
  // NaN.
  void write(const vm::Vm& vm);

  const std::vector<std::string>& names() const { return names_; }

 private:
  // option: as the user gave it, for the messages.
  void add(const std::string& option, const std::string& name, const program::Program&);

  int descriptor_;
  std::vector<std::string> names_;
  std::uint32_t width_, height_;
  std::vector<float> values_;  // of one register
};

}  // namespace apron::run

// `apron run --save REGISTER=FILE`: registers that are written to files when the run ends.
#pragma once

#include <string>
#include <vector>

#include "apron/program/Program.h"
#include "apron/vm/Host.h"
#include "apron/vm/Vm.h"

namespace apron::run {

struct SavedRegister {
  std::string name, file;
};

// Why the program cannot have these registers saved, in one line; empty if it can. Checks names, not contents.
std::string unsavable_reason(const std::vector<SavedRegister>&, const program::Program&);

// Writes .npy and .csv files as io.array.save does, and pictures as io.image.save. Returns a one-line error, or empty.
std::string save_registers(const std::vector<SavedRegister>&, const vm::Vm&, vm::Host&);

}  // namespace apron::run

// `apron run --save REGISTER=FILE`: registers that are written to files when the run ends.
#pragma once

#include <string>
#include <vector>

#include "apron/program/Program.h"
#include "apron/vm/Vm.h"

namespace apron::run {

struct SavedRegister {
  std::string name, file;
};

// Throws common::UserError if the program has no such register, or the file's name no extension that is
// known.
void check_saved(const std::vector<SavedRegister>&, const program::Program&);

// Writes .npy and .csv files as io.array.save does, and pictures as io.image.save. Returns a one-line error,
// or empty.
std::string save_registers(const std::vector<SavedRegister>&, const vm::Vm&);

}  // namespace apron::run

// Confines the process once a program is compiled: from then on it opens files in the program's folder and in
// those of --allow alone, and runs no other program. A broker names the outputs of the command line.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "apron/run/options/Options.h"
#include "common/confine/Broker.h"
#include "common/files/Inputs.h"
#include "common/files/PreparedOutputs.h"

namespace apron::run {

// The program's own folder and those of --allow.
std::vector<std::string> program_folders(const Options&);

class ConfinedProgram {
 public:
  // Confines nothing with native modules, or with windows and pictures, whose drivers may do anything. Throws
  // common::UserError if an output cannot be written.
  ConfinedProgram(const Options&, const std::vector<common::NamedOutput>& outputs);
  ~ConfinedProgram();
  ConfinedProgram(const ConfinedProgram&) = delete;
  ConfinedProgram& operator=(const ConfinedProgram&) = delete;

 private:
  std::vector<common::PreparedOutput> outputs_;
  std::unique_ptr<common::Broker> broker_;  // null: there are no outputs, or the process is not confined
};

}  // namespace apron::run

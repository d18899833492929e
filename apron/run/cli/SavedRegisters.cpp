#include "apron/run/cli/SavedRegisters.h"

#include <algorithm>

#include "apron/run/media/ImageFile.h"
#include "apron/run/media/MediaFile.h"
#include "common/text/Suggestion.h"

namespace apron::run {
namespace {

std::size_t register_index(const program::Program& program, const std::string& name) {
  const auto found = std::find_if(program.registers.begin(), program.registers.end(),
                                  [&](const auto& reg) { return reg.name == name; });
  return static_cast<std::size_t>(found - program.registers.begin());
}

}  // namespace

std::string unsavable_reason(const std::vector<SavedRegister>& saved, const program::Program& program) {
  std::vector<std::string> known;
  for (const auto& reg : program.registers)
    if (reg.name.front() != '$') known.push_back(reg.name);
  for (const SavedRegister& one : saved) {
    if (register_index(program, one.name) == program.registers.size())
      return "--save: the program has no register '" + one.name + "'" + common::did_you_mean(one.name, known);
    if (const std::string ending = extension(one.file);
        ending != "npy" && ending != "csv" && !is_image_name(one.file))
      return "--save: '" + one.file + "' must end in .npy, .csv, .png, .pgm, .jpg, .jpeg or .bmp";
  }
  return {};
}

std::string save_registers(const std::vector<SavedRegister>& saved, const vm::Vm& vm, vm::Host& host) {
  for (const SavedRegister& one : saved) {
    const vm::Plane plane = vm.plane(register_index(vm.program(), one.name));
    const vm::HostStatus status =
        is_image_name(one.file) ? host.save_image(one.file, plane) : host.save_array(one.file, plane);
    if (status != vm::HostStatus::kOk) return "--save: " + host.message();
  }
  return {};
}

}  // namespace apron::run

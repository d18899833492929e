#include "apron/run/media/SavedRegisters.h"

#include "apron/run/media/ImageFile.h"
#include "apron/run/media/MediaFile.h"
#include "common/error/UserError.h"

namespace apron::run {

void check_saved(const std::vector<SavedRegister>& saved, const program::Program& program) {
  for (const SavedRegister& one : saved) {
    if (!program::find_register(program, one.name))
      throw common::UserError("--save: the program has no register " +
                              program::unknown_register(program, one.name));
    if (const std::string ending = extension(one.file);
        ending != "npy" && ending != "csv" && !is_image_name(one.file))
      throw common::UserError("--save: '" + one.file +
                              "' must end in .npy, .csv, .png, .pgm, .jpg, .jpeg or .bmp");
  }
}

std::string save_registers(const std::vector<SavedRegister>& saved, const vm::Vm& vm, vm::Host& host) {
  for (const SavedRegister& one : saved) {
    const vm::Plane plane = vm.plane(*program::find_register(vm.program(), one.name));
    const vm::HostStatus status =
        is_image_name(one.file) ? host.save_image(one.file, plane) : host.save_array(one.file, plane);
    if (status != vm::HostStatus::kOk) return "--save: " + host.message();
  }
  return {};
}

}  // namespace apron::run

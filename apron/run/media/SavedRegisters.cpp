#include "apron/run/media/SavedRegisters.h"

#include <new>

#include "apron/run/media/ArrayFile.h"
#include "apron/run/media/ImageFile.h"
#include "apron/run/media/MediaError.h"
#include "apron/run/media/MediaFile.h"
#include "common/error/UserError.h"
#include "common/files/Inputs.h"

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

std::string save_registers(const std::vector<SavedRegister>& saved, const vm::Vm& vm) {
  for (const SavedRegister& one : saved) {
    if (common::withheld(one.file)) continue;  // the program has ended with an error that says why
    const vm::Plane plane = vm.plane(*program::find_register(vm.program(), one.name));
    try {
      if (is_image_name(one.file))
        write_image(one.file, plane);
      else
        write_array(one.file, plane);
    } catch (const MediaError& error) {
      return std::string("--save: ") + error.what();
    } catch (const std::bad_alloc&) {
      return "--save: there is not enough memory for '" + one.file + "'";
    }
  }
  return {};
}

}  // namespace apron::run

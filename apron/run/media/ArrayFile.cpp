#include "apron/run/media/ArrayFile.h"

#include "apron/run/media/CsvCodec.h"
#include "apron/run/media/MediaFile.h"
#include "apron/run/media/NpyCodec.h"

namespace apron::run {
namespace {

[[noreturn]] void unknown_format(const std::string& path) {
  throw_refused(path, "is not an array file: the name must end in .npy or .csv");
}

}  // namespace

void read_array(const std::string& path, const vm::Plane& to) {
  const std::string format = extension(path);
  if (format == "npy") return decode_npy(path, read_file(path), to);
  if (format == "csv") return decode_csv(path, read_file(path), to);
  unknown_format(path);
}

void write_array(const std::string& path, const vm::ConstPlane& from) {
  const std::string format = extension(path);
  if (format == "npy") return write_file(path, encode_npy(from));
  if (format == "csv") return write_file(path, encode_csv(from));
  unknown_format(path);
}

}  // namespace apron::run

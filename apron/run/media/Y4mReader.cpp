#include "apron/run/media/Y4mReader.h"

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <sstream>
#include <string>
#include <system_error>

#include "apron/run/media/MediaFile.h"
#include "common/files/Inputs.h"

namespace apron::run {
namespace {

constexpr std::size_t kMaxLineBytes = 1024;
constexpr std::uint32_t kMaxDimension = 65536;

// The number in "W640" or "H480"; 0 if there is none.
std::uint32_t parse_dimension(const std::string& path, const std::string& word) {
  const std::string digits = word.substr(1);
  if (digits.find_first_not_of("0123456789") != digits.npos) return 0;
  std::uint32_t value = 0;
  const auto [rest, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error == std::errc::result_out_of_range || value > kMaxDimension)
    throw_refused(path, "has the size " + word + " in its header; at most " + std::to_string(kMaxDimension) +
                            " columns and rows are read");
  return value;
}

// The size of both chroma planes, or -1 for an unsupported format.
std::int64_t chroma_bytes(const std::string& format, std::uint32_t width, std::uint32_t height) {
  const std::int64_t columns = (width + 1) / 2, rows = (height + 1) / 2;
  if (format == "mono") return 0;
  if (format == "444") return std::int64_t{2} * width * height;
  if (format == "422") return 2 * columns * height;
  if (format == "420" || format == "420jpeg" || format == "420mpeg2" || format == "420paldv")
    return 2 * columns * rows;
  return -1;
}

bool read_line(std::ifstream& file, std::string& line) {
  line.clear();
  for (int c = file.get(); c != '\n'; c = file.get()) {
    if (c == std::ifstream::traits_type::eof() || line.size() == kMaxLineBytes) return false;
    line.push_back(static_cast<char>(c));
  }
  return true;
}

}  // namespace

Y4mReader::Y4mReader(const std::string& path) : path_(path) {
  if (extension(path) != "y4m") throw_refused(path, "is not a supported video: the name must end in .y4m");
  std::error_code error;
  if (std::filesystem::exists(path, error) && !std::filesystem::is_regular_file(path, error))
    throw_refused(path, "is not a regular file");
  common::note_input(path);
  file_.open(path, std::ios::binary);
  if (!file_) throw_refused(path, "cannot be read");
  std::string line, word, format = "420";
  if (!read_line(file_, line)) throw_refused(path, "is not a YUV4MPEG2 file");
  std::istringstream words(line);
  words >> word;
  if (word != "YUV4MPEG2") throw_refused(path, "is not a YUV4MPEG2 file");
  while (words >> word) {
    if (word[0] == 'W') frame_.width = parse_dimension(path, word);
    if (word[0] == 'H') frame_.height = parse_dimension(path, word);
    if (word[0] == 'C') format = word.substr(1);
  }
  if (frame_.width == 0 || frame_.height == 0) throw_refused(path, "does not state its width and height");
  const std::int64_t bytes = chroma_bytes(format, frame_.width, frame_.height);
  if (bytes < 0) throw_refused(path, "has colours in the format '" + format + "', which is not supported");
  chroma_bytes_ = bytes;
  first_frame_ = file_.tellg();
  // A damaged header must not make us allocate its frame.
  const auto frame_bytes = std::int64_t{frame_.width} * frame_.height + bytes;
  const auto rest = static_cast<std::int64_t>(std::filesystem::file_size(path, error)) - first_frame_;
  if (error || (rest > 0 && rest < frame_bytes)) throw_refused(path, "ends inside a frame");
}

bool Y4mReader::read_frame_header() {
  std::string line;
  return read_line(file_, line) && line.compare(0, 5, "FRAME") == 0;
}

const GreyFrame& Y4mReader::next_frame() {
  if (!read_frame_header()) {
    file_.clear();
    file_.seekg(first_frame_);
    if (!read_frame_header()) throw_refused(path_, "has no frame");
  }
  frame_.pixels.resize(std::size_t{frame_.width} * frame_.height);
  file_.read(reinterpret_cast<char*>(frame_.pixels.data()),
             static_cast<std::streamsize>(frame_.pixels.size()));
  file_.ignore(static_cast<std::streamsize>(chroma_bytes_));
  if (!file_) throw_refused(path_, "ends inside a frame");
  return frame_;
}

void Y4mReader::read_frame(const vm::Plane& to) {
  require_shape(path_, frame_.width, frame_.height, to);
  const GreyFrame& frame = next_frame();
  for (std::uint32_t y = 0; y < to.height; ++y)
    std::copy_n(frame.pixels.begin() + std::ptrdiff_t{y} * to.width, to.width, to.row(y));
}

}  // namespace apron::run

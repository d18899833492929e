#include "apron/run/NpyBytes.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <vector>

#include "apron/run/MediaFile.h"

namespace apron::run {
namespace {

static_assert(std::endian::native == std::endian::little,
              "cells are copied to and from the file as they are");

constexpr std::string_view kMagic = "\x93NUMPY";

struct Header {
  char kind = 'f';       // f, i, u or b
  std::size_t size = 4;  // bytes an element
  bool big_endian = false;
  bool columns_first = false;  // Fortran order
  std::uint64_t width = 0, height = 0;
  std::string_view cells;
};

// The text after 'key': in the header's dictionary.
std::string_view after_key(const std::string& path, std::string_view dictionary, std::string_view key) {
  const std::size_t at = dictionary.find(std::string("'").append(key).append("'"));
  const std::size_t colon = at == std::string_view::npos ? at : dictionary.find(':', at);
  const std::size_t value =
      colon == std::string_view::npos ? colon : dictionary.find_first_not_of(' ', colon + 1);
  if (value == std::string_view::npos)
    refuse(path, std::string("has no '").append(key).append("' in its .npy header"));
  return dictionary.substr(value);
}

void parse_type(const std::string& path, std::string_view text, Header& header) {
  const std::size_t end = text.size() > 1 && text[0] == '\'' ? text.find('\'', 1) : std::string_view::npos;
  const std::string_view type = end == std::string_view::npos ? std::string_view{} : text.substr(1, end - 1);
  const bool known = type.size() == 3 && std::string_view("<>|=").find(type[0]) != std::string_view::npos;
  header.big_endian = known && type[0] == '>';
  header.kind = known ? type[1] : '?';
  header.size = known ? static_cast<std::size_t>(type[2] - '0') : 0;
  const std::size_t size = header.size;
  const bool whole = size == 1 || size == 2 || size == 4 || size == 8;
  if (!(header.kind == 'f' && (size == 4 || size == 8)) && !(header.kind == 'b' && size == 1) &&
      !((header.kind == 'i' || header.kind == 'u') && whole))
    refuse(path, "holds elements of type '" + std::string(type.substr(0, 40)) +
                     "'; real, whole and truth values can be read");
}

void parse_shape(const std::string& path, std::string_view text, Header& header) {
  std::vector<std::uint64_t> lengths;
  const char* at = text.data() + 1;
  const char* const end = text.data() + std::min(text.size(), text.find(')'));
  if (text[0] != '(') refuse(path, "has a damaged shape in its .npy header");
  while (at < end) {
    if (*at == ' ' || *at == ',') {
      ++at;
      continue;
    }
    const auto [next, error] = std::from_chars(at, end, lengths.emplace_back());
    if (error != std::errc{}) refuse(path, "has a damaged shape in its .npy header");
    at = next;
  }
  if (lengths.empty() || lengths.size() > 2)
    refuse(path, "has " + std::to_string(lengths.size()) + " dimensions; a register has 2");
  header.width = lengths.back();
  header.height = lengths.size() == 2 ? lengths[0] : 1;
}

Header parse_header(const std::string& path, std::string_view bytes) {
  if (bytes.size() < 10 || bytes.substr(0, kMagic.size()) != kMagic) refuse(path, "is not a .npy file");
  const std::size_t size_bytes = bytes[6] == 1 ? 2 : 4;
  const std::size_t begin = 8 + size_bytes;
  if (bytes[6] < 1 || bytes[6] > 3) refuse(path, "is of an unknown .npy version");
  std::uint32_t length = 0;
  if (bytes.size() >= begin) std::memcpy(&length, bytes.data() + 8, size_bytes);
  if (bytes.size() < begin || bytes.size() - begin < length) refuse(path, "ends within its .npy header");
  const std::string_view dictionary = bytes.substr(begin, length);
  Header header;
  parse_type(path, after_key(path, dictionary, "descr"), header);
  header.columns_first = after_key(path, dictionary, "fortran_order").starts_with("True");
  parse_shape(path, after_key(path, dictionary, "shape"), header);
  header.cells = bytes.substr(begin + length);
  return header;
}

template <class T>
float element(const char* at, bool swap) {
  char raw[sizeof(T)];
  std::memcpy(raw, at, sizeof(T));
  if (swap) std::reverse(raw, raw + sizeof(T));
  T value;
  std::memcpy(&value, raw, sizeof(T));
  return static_cast<float>(value);
}

float element(const Header& h, const char* at) {
  switch (h.kind) {
    case 'f':
      return h.size == 4 ? element<float>(at, h.big_endian) : element<double>(at, h.big_endian);
    case 'b':
      return *at != 0 ? 1.0F : 0.0F;
    case 'i':
      return h.size == 1   ? element<std::int8_t>(at, false)
             : h.size == 2 ? element<std::int16_t>(at, h.big_endian)
             : h.size == 4 ? element<std::int32_t>(at, h.big_endian)
                           : element<std::int64_t>(at, h.big_endian);
    default:
      return h.size == 1   ? element<std::uint8_t>(at, false)
             : h.size == 2 ? element<std::uint16_t>(at, h.big_endian)
             : h.size == 4 ? element<std::uint32_t>(at, h.big_endian)
                           : element<std::uint64_t>(at, h.big_endian);
  }
}

}  // namespace

void decode_npy(const std::string& path, std::string_view bytes, const vm::Plane& to) {
  const Header header = parse_header(path, bytes);
  require_shape(path, header.width, header.height, to);
  if (header.cells.size() < to.cell_count() * header.size) refuse(path, "ends before its last element");
  const std::size_t along_x = header.columns_first ? to.height : 1,
                    along_y = header.columns_first ? 1 : to.width;
  for (std::uint32_t y = 0; y < to.height; ++y)
    for (std::uint32_t x = 0; x < to.width; ++x)
      to.row(y)[x] = element(header, header.cells.data() + (x * along_x + y * along_y) * header.size);
}

std::string encode_npy(const vm::ConstPlane& from) {
  constexpr std::size_t kBefore = 10, kUnit = 64;  // of the header's padding
  std::string dictionary = "{'descr': '<f4', 'fortran_order': False, 'shape': (" +
                           std::to_string(from.height) + ", " + std::to_string(from.width) + "), }";
  dictionary.append(kUnit - (kBefore + dictionary.size() + 1) % kUnit, ' ').push_back('\n');
  std::string bytes(kMagic);
  bytes += {'\x01', '\x00', static_cast<char>(dictionary.size() & 0xFF),
            static_cast<char>(dictionary.size() >> 8)};
  bytes += dictionary;
  bytes.reserve(bytes.size() + from.cell_count() * sizeof(float));
  for (std::uint32_t y = 0; y < from.height; ++y)
    bytes.append(reinterpret_cast<const char*>(from.row(y)), from.width * sizeof(float));
  return bytes;
}

}  // namespace apron::run

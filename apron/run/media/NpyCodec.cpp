#include "apron/run/media/NpyCodec.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <vector>

#include "apron/run/media/MediaFile.h"

namespace apron::run {
namespace {

static_assert(std::endian::native == std::endian::little,
              "cells are copied to and from the file as they are");

constexpr std::string_view kMagic = "\x93NUMPY";

struct NpyHeader {
  char type_kind = 'f';          // f, i, u or b
  std::size_t element_size = 4;  // bytes
  bool big_endian = false;
  bool fortran_order = false;  // column-major
  std::uint64_t width = 0, height = 0;
  std::string_view data;
};

// The rest of the header's dictionary after 'key':.
std::string_view value_of_key(const std::string& path, std::string_view dictionary, std::string_view key) {
  const std::size_t at = dictionary.find(std::string("'").append(key).append("'"));
  const std::size_t colon = at == std::string_view::npos ? at : dictionary.find(':', at);
  const std::size_t value =
      colon == std::string_view::npos ? colon : dictionary.find_first_not_of(' ', colon + 1);
  if (value == std::string_view::npos)
    throw_refused(path, std::string("has no '").append(key).append("' in its .npy header"));
  return dictionary.substr(value);
}

void parse_type(const std::string& path, std::string_view text, NpyHeader& header) {
  const std::size_t end = text.size() > 1 && text[0] == '\'' ? text.find('\'', 1) : std::string_view::npos;
  const std::string_view type = end == std::string_view::npos ? std::string_view{} : text.substr(1, end - 1);
  const bool known = type.size() == 3 && std::string_view("<>|=").find(type[0]) != std::string_view::npos;
  header.big_endian = known && type[0] == '>';
  header.type_kind = known ? type[1] : '?';
  header.element_size = known ? type[2] - '0' : 0;
  const std::size_t size = header.element_size;
  const bool valid_integer_size = size == 1 || size == 2 || size == 4 || size == 8;
  if (!(header.type_kind == 'f' && (size == 4 || size == 8)) && !(header.type_kind == 'b' && size == 1) &&
      !((header.type_kind == 'i' || header.type_kind == 'u') && valid_integer_size))
    throw_refused(path, "holds elements of type '" + std::string(type.substr(0, 40)) +
                            "'; supported types: float32, float64, int8 to int64, uint8 to uint64 and bool");
}

void parse_shape(const std::string& path, std::string_view text, NpyHeader& header) {
  std::vector<std::uint64_t> lengths;
  const char* at = text.data() + 1;
  const char* const end = text.data() + std::min(text.size(), text.find(')'));
  if (text[0] != '(') throw_refused(path, "has a damaged shape in its .npy header");
  while (at < end) {
    if (*at == ' ' || *at == ',') {
      ++at;
      continue;
    }
    const auto [next, error] = std::from_chars(at, end, lengths.emplace_back());
    if (error != std::errc{}) throw_refused(path, "has a damaged shape in its .npy header");
    at = next;
  }
  if (lengths.empty() || lengths.size() > 2)
    throw_refused(path, "has " + std::to_string(lengths.size()) + " dimensions; a register has 2");
  header.width = lengths.back();
  header.height = lengths.size() == 2 ? lengths[0] : 1;
}

NpyHeader parse_header(const std::string& path, std::string_view bytes) {
  if (bytes.size() < 10 || bytes.substr(0, kMagic.size()) != kMagic)
    throw_refused(path, "is not a .npy file");
  const std::size_t size_bytes = bytes[6] == 1 ? 2 : 4;
  const std::size_t begin = 8 + size_bytes;
  if (bytes[6] < 1 || bytes[6] > 3) throw_refused(path, "has an unknown .npy version");
  std::uint32_t length = 0;
  if (bytes.size() >= begin) std::memcpy(&length, bytes.data() + 8, size_bytes);
  if (bytes.size() < begin || bytes.size() - begin < length)
    throw_refused(path, "ends within its .npy header");
  const std::string_view dictionary = bytes.substr(begin, length);
  NpyHeader header;
  parse_type(path, value_of_key(path, dictionary, "descr"), header);
  header.fortran_order = value_of_key(path, dictionary, "fortran_order").starts_with("True");
  parse_shape(path, value_of_key(path, dictionary, "shape"), header);
  header.data = bytes.substr(begin + length);
  return header;
}

template <class T>
double read_element(const char* source, bool swap) {
  char raw[sizeof(T)];
  std::memcpy(raw, source, sizeof(T));
  if (swap) std::reverse(raw, raw + sizeof(T));
  T value;
  std::memcpy(&value, raw, sizeof(T));
  return static_cast<double>(value);
}

double read_element(const NpyHeader& header, const char* source) {
  switch (header.type_kind) {
    case 'f':
      return header.element_size == 4 ? read_element<float>(source, header.big_endian)
                                      : read_element<double>(source, header.big_endian);
    case 'b':
      return *source != 0 ? 1.0 : 0.0;
    case 'i':
      return header.element_size == 1   ? read_element<std::int8_t>(source, false)
             : header.element_size == 2 ? read_element<std::int16_t>(source, header.big_endian)
             : header.element_size == 4 ? read_element<std::int32_t>(source, header.big_endian)
                                        : read_element<std::int64_t>(source, header.big_endian);
    default:
      return header.element_size == 1   ? read_element<std::uint8_t>(source, false)
             : header.element_size == 2 ? read_element<std::uint16_t>(source, header.big_endian)
             : header.element_size == 4 ? read_element<std::uint32_t>(source, header.big_endian)
                                        : read_element<std::uint64_t>(source, header.big_endian);
  }
}

}  // namespace

void decode_npy(const std::string& path, std::string_view bytes, const vm::Plane& to) {
  const NpyHeader header = parse_header(path, bytes);
  require_shape(path, header.width, header.height, to);
  if (header.data.size() < to.cell_count() * header.element_size)
    throw_refused(path, "ends before its last element");
  const std::size_t stride_x = header.fortran_order ? to.height : 1,
                    stride_y = header.fortran_order ? 1 : to.width;
  for (std::uint32_t y = 0; y < to.height; ++y)
    for (std::uint32_t x = 0; x < to.width; ++x)
      store_cell(
          path, to, x, y,
          read_element(header, header.data.data() + (x * stride_x + y * stride_y) * header.element_size));
}

std::string encode_npy(const vm::ConstPlane& from) {
  constexpr std::size_t kPrefixBytes = 10, kAlignment = 64;  // the header is padded to kAlignment
  static constexpr std::array<std::string_view, program::kCellTypeCount> kTypes{"<f4", "<i4", "<u2", "|u1"};
  std::string dictionary = "{'descr': '" + std::string(kTypes[index_of(from.type)]) +
                           "', 'fortran_order': False, 'shape': (" + std::to_string(from.height) + ", " +
                           std::to_string(from.width) + "), }";
  dictionary.append(kAlignment - (kPrefixBytes + dictionary.size() + 1) % kAlignment, ' ').push_back('\n');
  std::string bytes(kMagic);
  bytes += {'\x01', '\x00', static_cast<char>(dictionary.size() & 0xFF),
            static_cast<char>(dictionary.size() >> 8)};
  bytes += dictionary;
  bytes.reserve(bytes.size() + from.cell_count() * from.cell_bytes());
  for (std::uint32_t y = 0; y < from.height; ++y)
    bytes.append(reinterpret_cast<const char*>(from.row_bytes(y)), from.width * from.cell_bytes());
  return bytes;
}

}  // namespace apron::run

#include "common/files/ElfFile.h"

#include <elf.h>

#include <cstdint>
#include <cstring>
#include <fstream>

namespace common {

std::string find_missing_segment(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  Elf64_Ehdr header{};
  in.read(reinterpret_cast<char*>(&header), sizeof header);
  if (!in || std::memcmp(header.e_ident, ELFMAG, SELFMAG) != 0 || header.e_ident[EI_CLASS] != ELFCLASS64 ||
      header.e_phentsize != sizeof(Elf64_Phdr))
    return "";
  std::error_code error;
  const std::uint64_t size = std::filesystem::file_size(file, error);
  if (error) return "";
  const auto needs = [size](std::uint64_t bytes) {
    return "is cut short: it has " + std::to_string(size) + " bytes and needs " + std::to_string(bytes);
  };
  in.seekg(static_cast<std::streamoff>(header.e_phoff));
  for (int i = 0; i < header.e_phnum; ++i) {
    Elf64_Phdr segment{};
    in.read(reinterpret_cast<char*>(&segment), sizeof segment);
    if (!in) return needs(header.e_phoff + std::uint64_t{header.e_phnum} * sizeof segment);
    if (segment.p_type != PT_LOAD) continue;
    if (segment.p_offset > size || segment.p_filesz > size - segment.p_offset)
      return needs(segment.p_offset + segment.p_filesz);
  }
  return "";
}

}  // namespace common

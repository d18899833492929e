// Compiles every script of the directories and passes the program to the fuzz target of the verifier,
// unchanged and with ROUNDS deterministic mutations. --write writes the programs as a corpus instead.
//
//   apron_verifier_replay ROUNDS DIRECTORY…
//   apron_verifier_replay --write NEW_DIRECTORY DIRECTORY…
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <random>
#include <string>
#include <vector>

#include "apron/compiler/Compiler.h"
#include "apron/syntax/FileReader.h"
#include "tests/fuzz/apron/ProgramCodec.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace {

using Bytes = std::vector<std::uint8_t>;
using Path = std::filesystem::path;

std::vector<Path> scripts(int argc, char** argv, int first) {
  std::vector<Path> files;
  for (int i = first; i < argc; ++i)
    for (const auto& entry : std::filesystem::directory_iterator(argv[i]))
      if (entry.path().extension() == ".aps") files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

// Returns the encoded program; empty for scripts that do not compile on purpose.
Bytes compiled(const Path& file) {
  apron::compiler::CompileOptions options;
  options.file = file.string();
  options.width = 7;
  options.height = 5;
  options.library_path = APRON_SCRIPTS;
  apron::syntax::DiskReader reader;
  apron::compiler::CompileResult result = apron::compiler::compile(options, reader);
  if (!result.program) return {};
  // Mutations must not depend on the location of the checkout.
  for (std::string& name : result.program->files) name = Path(name).filename().string();
  return fuzz::encode(*result.program);
}

// Changes 1 to 6 bytes: most programs stay valid after one or two changes, few after more.
Bytes mutate_bytes(Bytes bytes, std::mt19937& rng) {
  for (unsigned changes = 1 + rng() % 6; changes > 0; --changes) {
    const std::size_t position = rng() % bytes.size();
    switch (rng() % 4) {
      case 0:
        bytes[position] ^= static_cast<std::uint8_t>(1U << (rng() % 8));
        break;
      case 1:
        bytes[position] = static_cast<std::uint8_t>(rng() % 12);
        break;
      case 2:
        bytes[position] = bytes[rng() % bytes.size()];
        break;
      default:
        bytes[position] = static_cast<std::uint8_t>(rng());
    }
  }
  if (rng() % 16 == 0) bytes.resize(rng() % bytes.size() + 1);
  return bytes;
}

void write(const Path& directory, const Path& script, const Bytes& bytes) {
  std::filesystem::create_directories(directory);
  std::ofstream file(directory / script.stem(), std::ios::binary);
  for (const std::uint8_t byte : bytes) file.put(static_cast<char>(byte));
}

}  // namespace

int main(int argc, char** argv) {
  const bool to_disk = argc > 3 && std::string(argv[1]) == "--write";
  std::mt19937 rng(1);
  std::size_t programs = 0;
  for (const Path& script : scripts(argc, argv, to_disk ? 3 : 2)) {
    const Bytes bytes = compiled(script);
    if (bytes.empty()) continue;
    ++programs;
    if (to_disk) {
      write(argv[2], script, bytes);
      continue;
    }
    std::cout << script.string() << std::endl;  // flushed, so that the output of a crash ends with its script
    LLVMFuzzerTestOneInput(bytes.data(), bytes.size());
    for (int round = std::atoi(argv[1]); round > 0; --round) {
      const Bytes other = mutate_bytes(bytes, rng);
      LLVMFuzzerTestOneInput(other.data(), other.size());
    }
  }
  std::cout << programs << " programs\n";
  return programs >= 20 ? 0 : 1;
}

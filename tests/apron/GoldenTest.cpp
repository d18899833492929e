// Runs one APRON script with each instruction set of this CPU, and compares its output with the comments in
// the script:
//
//   // args: --size 8x4        additional arguments for `apron run`
//   // expect: text            the next line of standard output; every line must be expected
//   // expect-exit: 2          the exit status; default 0
//   // expect-error: text      a substring of standard error, which otherwise must be empty
//
// Usage: apron_golden APRON SCRIPT [ARGUMENT…]. Runs the script in a temporary directory.
#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <sstream>
#include <string>
#include <vector>

namespace {

namespace fs = std::filesystem;

struct Expectation {
  std::vector<std::string> arguments;
  std::vector<std::string> errors;
  std::string output;
  int exit_status = 0;
};

Expectation read_expectation(const fs::path& script) {
  Expectation expectation;
  std::ifstream file(script);
  for (std::string line; std::getline(file, line);) {
    const auto after = [&](const std::string& key, std::string& rest) {
      const std::size_t at = line.find("// " + key + ":");
      if (at == std::string::npos) return false;
      rest = line.substr(at + key.size() + 4);
      if (!rest.empty() && rest.front() == ' ') rest.erase(0, 1);
      return true;
    };
    std::string rest;
    if (after("args", rest)) {
      std::istringstream words(rest);
      for (std::string word; words >> word;) expectation.arguments.push_back(word);
    } else if (after("expect", rest)) {
      expectation.output.append(rest).append("\n");
    } else if (after("expect-exit", rest)) {
      expectation.exit_status = std::stoi(rest);
    } else if (after("expect-error", rest)) {
      expectation.errors.push_back(rest);
    }
  }
  return expectation;
}

std::string read_text(const fs::path& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

int run(std::vector<std::string> arguments, const fs::path& directory) {
  std::vector<char*> argv;
  for (std::string& a : arguments) argv.push_back(a.data());
  argv.push_back(nullptr);
  const pid_t child = fork();
  if (child == 0) {
    if (chdir(directory.c_str()) != 0) _exit(99);
    dup2(open("stdout", O_WRONLY | O_CREAT, 0600), STDOUT_FILENO);
    dup2(open("stderr", O_WRONLY | O_CREAT, 0600), STDERR_FILENO);
    execv(argv[0], argv.data());
    _exit(99);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

}  // namespace

namespace {

// Returns whether the script does what it expects with `isa`.
bool check(const std::string& isa, std::vector<std::string> arguments, const Expectation& expectation) {
  std::string name = (fs::temp_directory_path() / "apron_golden_XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr) return false;
  const fs::path directory = name;
  arguments.insert(arguments.end(), {"--isa", isa});
  const int status = run(arguments, directory);
  const std::string output = read_text(directory / "stdout"), error = read_text(directory / "stderr");
  fs::remove_all(directory);
  if (error.find("this computer does not have " + isa) != std::string::npos) return true;

  bool good = status == expectation.exit_status && output == expectation.output &&
              error.empty() == expectation.errors.empty();
  for (const std::string& part : expectation.errors) good = good && error.find(part) != std::string::npos;
  if (good) return true;
  std::cout << isa << ": exit status " << status << ", expected " << expectation.exit_status
            << "\n---- output\n"
            << output << "---- expected\n"
            << expectation.output << "---- standard error\n"
            << error;
  for (const std::string& part : expectation.errors) std::cout << "---- expected there: " << part << '\n';
  return false;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) return 2;
  const fs::path script = fs::absolute(argv[2]);
  const Expectation expectation = read_expectation(script);
  std::vector<std::string> arguments = {fs::absolute(argv[1]).string(), "run", script.string()};
  arguments.insert(arguments.end(), argv + 3, argv + argc);
  arguments.insert(arguments.end(), expectation.arguments.begin(), expectation.arguments.end());
  bool good = true;
  for (const char* isa : {"portable", "avx2", "avx512"}) good = check(isa, arguments, expectation) && good;
  return good ? 0 : 1;
}

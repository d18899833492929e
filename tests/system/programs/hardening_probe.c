/* Compiled with the options that harden the programs, for programs.Loading: has a buffer, a copy of unknown
 * length and a call through a pointer. */
#include <stdio.h>
#include <string.h>

static void print(const char* text) { puts(text); }

int main(int count, char** words) {
  char copy[64];
  void (*volatile show)(const char*) = print;
  memset(copy, 0, sizeof copy);
  memcpy(copy, words[0], strlen(words[0]) + (size_t)count);
  show(copy);
  return 0;
}

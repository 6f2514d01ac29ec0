// SPDX-License-Identifier: MIT
// Repeats recorded calls by the kernels that it is linked with, and compares every byte; see replay_elsewhere.py, which
// makes table.h and what comes on the standard input: for each call the kernel's number, its block, the numbers returned,
// and the regions of memory with their content before and after.
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "table.h"

#define MOST_REGIONS 64

static void take(void *to, size_t bytes) {
  if (bytes && fread(to, 1, bytes, stdin) != bytes) exit(2);
}

// Numbers that are no numbers count as equal, whatever their bits: processors differ in which of them they give.
static int same(const unsigned char *a, const unsigned char *b, size_t bytes) {
  size_t at = 0;
  for (; at + 8 <= bytes; at += 8) {
    double x, y;
    memcpy(&x, a + at, 8);
    memcpy(&y, b + at, 8);
    if (memcmp(a + at, b + at, 8) && !(isnan(x) && isnan(y))) return 0;
  }
  return memcmp(a + at, b + at, bytes - at) == 0;
}

int main(void) {
  static long equal[KERNELS], different[KERNELS];
  uint16_t number, count;
  while (fread(&number, 1, 2, stdin) == 2) {
    int64_t block[SLOTS], returned[SLOTS];
    uint64_t address[MOST_REGIONS];
    uint32_t size[MOST_REGIONS];
    unsigned char *memory[MOST_REGIONS], *place[MOST_REGIONS], *after[MOST_REGIONS];
    take(block, 8 * slots[number]);
    take(returned, 8 * returns[number]);
    take(&count, 2);
    for (int k = 0; k < count; k++) {
      take(&address[k], 8);
      take(&size[k], 4);
      // Aligned as it was.
      memory[k] = malloc(size[k] + 128);
      place[k] = memory[k] + (64 - (uintptr_t)memory[k] % 64) % 64 + address[k] % 64;
      after[k] = malloc(size[k]);
      take(place[k], size[k]);
      take(after[k], size[k]);
    }
    for (const int *slot = addresses[number]; *slot >= 0; slot++) {
      uint64_t given = block[*slot];
      block[*slot] = (int64_t)(uintptr_t)block;
      for (int k = 0; k < count; k++)
        if (given >= address[k] && given < address[k] + size[k])
          block[*slot] = (int64_t)(uintptr_t)(place[k] + (given - address[k]));
    }
    kernels[number](block);
    int good = same((unsigned char *)block, (unsigned char *)returned, 8 * returns[number]);
    for (int k = 0; k < count; k++) {
      good = good && same(place[k], after[k], size[k]);
      free(memory[k]);
      free(after[k]);
    }
    (good ? equal : different)[number]++;
  }
  long bad = 0;
  const char *comma = "";
  printf("{");
  for (int k = 0; k < KERNELS; k++) {
    bad += different[k];
    if (equal[k] + different[k] > 0) {
      printf("%s\"%s\": {\"equal\": %ld, \"different\": %ld}", comma, names[k], equal[k], different[k]);
      comma = ", ";
    }
  }
  printf("}\n");
  return bad != 0;
}

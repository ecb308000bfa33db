/* ptrace for the guest kernel of with-vcan.sh on processors with tile registers (AMX).

   The guest kernel keeps 2696 bytes of extended registers for each of its processes, all there were when it was
   written, and hands them back to the host.  The host takes them in whole only, and with tile registers that is 11008:
   the rest is filled up with zeros.  Their header says that the tiles are as at the start. */

#define _GNU_SOURCE
#include <elf.h>
#include <stdarg.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

static long put_registers(pid_t pid, const struct iovec *given) {
  static char whole[1 << 16];
  static size_t size;
  struct iovec all = {whole, sizeof whole};
  if (size == 0 && syscall(SYS_ptrace, PTRACE_GETREGSET, pid, NT_X86_XSTATE, &all) == 0) size = all.iov_len;
  if (given->iov_len >= size) return syscall(SYS_ptrace, PTRACE_SETREGSET, pid, NT_X86_XSTATE, given);
  memcpy(whole, given->iov_base, given->iov_len);
  memset(whole + given->iov_len, 0, size - given->iov_len);
  all = (struct iovec){whole, size};
  return syscall(SYS_ptrace, PTRACE_SETREGSET, pid, NT_X86_XSTATE, &all);
}

long ptrace(enum __ptrace_request request, ...) {
  va_list rest;
  va_start(rest, request);
  pid_t pid = va_arg(rest, pid_t);
  void *addr = va_arg(rest, void *), *data = va_arg(rest, void *);
  va_end(rest);
  if (request == PTRACE_SETREGSET && addr == (void *)NT_X86_XSTATE) return put_registers(pid, data);
  if (request == PTRACE_PEEKTEXT || request == PTRACE_PEEKDATA || request == PTRACE_PEEKUSER) {
    long word;  /* as the C library has it: the word is what is returned */
    return syscall(SYS_ptrace, request, pid, addr, &word) == -1 ? -1 : word;
  }
  return syscall(SYS_ptrace, request, pid, addr, data);
}

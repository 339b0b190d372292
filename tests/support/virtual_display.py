"""PROGRAM [ARGUMENT...]: runs it on a virtual display of its own, in which OpenGL is drawn in software."""
import os
import subprocess
import sys

told, tells = os.pipe()
xvfb = subprocess.Popen(["Xvfb", "-displayfd", str(tells), "-noreset", "-screen", "0", "1280x800x24", "-nolisten", "tcp"],
                        pass_fds=[tells], stderr=subprocess.DEVNULL)
os.close(tells)
with os.fdopen(told) as number:
    display = ":" + number.readline().strip()
try:
    status = subprocess.run(sys.argv[1:], env=dict(os.environ, DISPLAY=display)).returncode
finally:
    xvfb.kill()
    xvfb.communicate()
sys.exit(status)

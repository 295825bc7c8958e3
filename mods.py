import sys,subprocess,os
code="import sys\n"+sys.argv[1]+"\nprint('\\n'.join(sys.modules))"

"""Links to systems of the plant: the alarms and states of the axes leave the daemon here.

* ``running``: all configured links, in one thread; ``delivery``: each transition at least once, in order.
* ``mail``, ``mqtt``, ``webhook``: the links that send.
* ``opcua`` and its parts ``opcua_tree``, ``opcua_alarms``, ``opcua_access``: a server that others read.
* ``link_secrets``: passwords, keys and certificates.
"""

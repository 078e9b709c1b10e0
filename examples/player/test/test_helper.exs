Code.require_file("support/client.ex", __DIR__)
Code.require_file("../../../test/start.exs", __DIR__)

# On a busy machine a message may take its time; nothing waits longer than it must.
ExUnit.start(assert_receive_timeout: 3_000)
